"""The mesh in the tools of drone teams: MAVLink ground stations, and Cursor on Target.

`vehicles`, `reports`, `requests` and `cursor_on_target` have neither clock nor socket; `server`
has the thread.
"""
