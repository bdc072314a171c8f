"""The list of keys that the page shows has every key that it takes."""

from __future__ import annotations

import re
from pathlib import Path

STATIC = Path(__file__).resolve().parents[3] / "src" / "drone_mesh" / "console" / "static"


def test_each_key_of_the_page_is_in_its_list_of_keys() -> None:
    script = (STATIC / "app.js").read_text(encoding="utf-8")
    taken = re.search(r"^const KEYS = \{\n(.*?)^\};", script, re.M | re.S)
    assert taken is not None
    keys = re.findall(r'^  "?([^":\n]+)"?: \(\) =>', taken[1], re.M)
    assert {" ", "n", "/", "Delete", "?"} <= set(keys)
    page = (STATIC / "index.html").read_text(encoding="utf-8")
    named = re.findall(r"<dt>(.*?)</dt>", page[page.index("<h2>Keys</h2>") :])
    listed = {word for names in named for word in names.split(", ")}
    wanted = {"space" if key == " " else key.upper() if len(key) == 1 else key for key in keys}
    assert wanted - listed == set()
