"""The report's page: one self-contained HTML file (jinja2)."""

from __future__ import annotations

from pathlib import Path

import jinja2

from drone_mesh.lab.run_report.charts import messages_figure, outages_figure, timeline_figure
from drone_mesh.lab.run_report.maps import maps_figure
from drone_mesh.lab.run_report.story import RunStory
from drone_mesh.lab.run_report.tables import (
    EVENT_KINDS_LEFT_OUT,
    key_numbers,
    outages_in_words,
    repair_rows,
    repairs_left,
)
from drone_mesh.state.condition import find_trouble, summarise
from drone_mesh.view.palette import DARK, LIGHT, css_variables

ROWS_SHOWN = 40  # a longer table of outages is folded
_TEMPLATE = Path(__file__).resolve().parent / "page.html"


def render_page(story: RunStory, title: str) -> str:
    """The page as HTML text."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    return template.render(
        title=title,
        light=css_variables(LIGHT),
        dark=css_variables(DARK),
        numbers=key_numbers(story),
        summary=summarise(story.after.nodes, find_trouble(story.after.nodes)),
        repairs=repair_rows(story),
        outages_in_words=outages_in_words(story),
        rows_shown=ROWS_SHOWN,
        left=repairs_left(story),
        blips=story.blips,
        timeline=timeline_figure(story),
        outages=outages_figure(story) if story.outages else "",
        maps=maps_figure(story),
        messages=messages_figure(story),
        events=[event for event in story.events if event.kind not in EVENT_KINDS_LEFT_OUT],
        recorded=len(story.events),
    )
