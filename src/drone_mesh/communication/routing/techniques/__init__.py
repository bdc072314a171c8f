"""Routing techniques besides ChildTableTree (docs/techniques.md)."""
