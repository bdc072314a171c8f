"""Programs that prove what a mesh withstands: attackers and mutated packets."""
