"""Repair strategies that come with drone_mesh; docs/strategies.md compares them."""
