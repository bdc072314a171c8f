"""Routing techniques beside ChildTableTree (docs/techniques.md)."""
