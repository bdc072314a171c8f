"""The report: one file with everything in it, and the same tables for a paper."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from drone_mesh.lab.command import main
from drone_mesh.lab.metrics import listed
from drone_mesh.lab.results import load_results
from drone_mesh.lab.tables import cells_table, healing_table, paired_table

HEALING = """\
name: healing
title: A line that breaks
seeds: 4
base:
  layout: {kind: line, drones: 5}
  duration_s: 90
  faults: [{at_s: 12, kill: {number: 1, pick: cut_vertex}}]
sweep:
  timing.connection_lost_after_s: [30, 5]
  layout.drones: [5, 6]
metrics: [healed, t_total_s, packets]
compare: {over: timing.connection_lost_after_s, baseline: 30}
"""


@pytest.fixture(scope="module")
def results_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab")
    (folder / "healing.yaml").write_text(HEALING)
    out = folder / "results"
    assert main(["run", str(folder / "healing.yaml"), "--out", str(out), "--workers", "0"]) == 0
    return out


def test_the_page_needs_nothing_but_itself(results_folder: Path) -> None:
    assert main(["report", str(results_folder)]) == 0
    page = (results_folder / "report.html").read_text()
    assert not re.search(r'(src|href)="(?!#)', page)
    assert "A line that breaks" in page
    assert page.count("<svg") >= 3  # one axis, phases, healed over time
    assert "p (Holm)" in page
    assert "connection_lost_after_s" in page


def test_a_folder_may_have_a_name_in_any_bytes(results_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    shutil.copytree(results_folder, folder)
    sessions = (folder / "provenance.json").read_text(encoding="utf-8")
    named = sessions.replace(json.dumps(str(results_folder)), json.dumps(str(folder)))
    assert named != sessions
    (folder / "provenance.json").write_text(named, encoding="utf-8")
    assert main(["report", str(folder)]) == 0
    assert rb"caf\udce9" in (folder / "report.html").read_bytes()


@pytest.mark.slow
def test_the_same_rows_give_the_same_page(results_folder: Path, tmp_path: Path) -> None:
    first, second = results_folder / "report.html", tmp_path / "again.html"
    if not first.exists():  # of another test
        main(["report", str(results_folder)])
    main(["report", str(results_folder), "--out", str(second)])
    # matplotlib draws ids at random
    pages = [re.sub(r'(id="|#|url\(#)\w+', "", page.read_text()) for page in (first, second)]
    assert pages[0] == pages[1]


@pytest.mark.slow
def test_every_figure_and_table_is_exported(results_folder: Path) -> None:
    formats = [word for kind in ("png", "pdf", "csv", "latex") for word in ("--export", kind)]
    assert main(["report", str(results_folder), *formats]) == 0
    names = {path.name for path in (results_folder / "exports").iterdir()}
    for name in ("axis_layout_drones", "phases", "healed_over_time"):
        assert {f"{name}.png", f"{name}.pdf"} <= names
    for name in ("cells", "healing", "paired", "worst"):
        assert {f"{name}.csv", f"{name}.tex"} <= names
    assert (results_folder / "exports/phases.png").read_bytes().startswith(b"\x89PNG")
    assert r"\toprule" in (results_folder / "exports/cells.tex").read_text()


def test_parquet_holds_what_the_csv_files_hold_with_types(results_folder: Path) -> None:
    pandas = pytest.importorskip("pandas")
    assert main(["report", str(results_folder), "--export", "parquet"]) == 0
    for name in ("runs", "outages"):
        read = pandas.read_parquet(results_folder / f"exports/{name}.parquet")
        with (results_folder / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert len(read) == len(rows) > 0
        assert set(read.columns) == set(rows[0])
        assert read["run"].tolist() == [row["run"] for row in rows]
    assert read["lost_s"].tolist() == [float(row["lost_s"]) for row in rows]
    runs = pandas.read_parquet(results_folder / "exports/runs.parquet")
    assert {str(runs[name].dtype) for name in listed() if name in runs} == {"float64"}
    assert runs["layout.drones"].tolist() == [5, 6] * 8
    assert runs["key"].tolist() == [False] * 16
    assert runs["order_delivery"].isna().all()  # no orders were given


def test_without_its_library_the_export_names_the_extra(
    results_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "drone_mesh.lab.parquet", raising=False)
    assert main(["report", str(results_folder), "--export", "parquet"]) == 1
    assert "needs the Python package pyarrow: pip install 'drone_mesh[parquet]'" in (
        capsys.readouterr().err
    )


def test_the_tables_hold_what_runs_csv_holds(results_folder: Path) -> None:
    results = load_results(results_folder)
    table = cells_table(results)
    assert table.header[:4] == ["connection_lost_after_s", "drones", "n", "split"]
    assert [row[:4] for row in table.rows][0] == ["30", "5", "4", "4 of 4"]
    rows = list(csv.DictReader((results_folder / "runs.csv").open()))
    times = sorted(
        float(row["t_total_s"]) for row in rows
        if row["timing.connection_lost_after_s"] == "5.0" and row["layout.drones"] == "5"
    )  # fmt: skip
    healing = healing_table(results)
    assert healing is not None
    row = next(row for row in healing.rows if row[:2] == ["5", "5"])
    median = healing.header.index("median, s")
    assert float(row[median]) in times


def test_less_patience_is_better_and_the_paired_table_says_so(results_folder: Path) -> None:
    table = paired_table(load_results(results_folder))
    assert table is not None
    row = next(row for row in table.rows if row[1] == "5" and row[2] == "t_total_s")
    assert row[4].startswith("-")  # seconds less


def test_compare_prints_the_paired_difference(
    results_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cells = [f"timing.connection_lost_after_s={n},layout.drones=5" for n in (30, 5)]
    assert main(["compare", str(results_folder), *cells]) == 0
    printed = capsys.readouterr().out
    assert "A: timing.connection_lost_after_s=30 layout.drones=5" in printed
    assert "t_total_s" in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["layout.drones=5", "layout.drones=6"], "2 cells match, expected one"),
        (["layout.drones=7", "layout.drones=6"], "no cell matches; the cells are: "),
        (["layout.dron=5", "layout.drones=6"], "expected axis=value with one of"),
        (
            ["timing.connection_lost_after_s=5,layout.drones=5"] * 2 + ["--metric", "x"],
            "no column x",
        ),
    ],
)
def test_compare_names_what_is_wrong(
    results_folder: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", str(results_folder), *words]) == 1
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_a_page_about_one_run_can_be_written(results_folder: Path, tmp_path: Path) -> None:
    run = next(csv.DictReader((results_folder / "runs.csv").open()))["run"]
    page = tmp_path / "run.html"
    assert main(["show", str(results_folder), run, "--page", str(page)]) == 0
    assert "<svg" in page.read_text()


def test_plot_writes_a_figure_that_is_light_or_dark_as_its_viewer_prefers(
    results_folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "healed.svg"
    assert main(["plot", str(results_folder), "healed_over_time", str(out)]) == 0
    svg = out.read_text(encoding="utf-8")
    assert svg.startswith("<svg")
    assert "@media(prefers-color-scheme:dark)" in svg
    assert "var(--ink)" in svg
    one = tmp_path / "one.svg"
    only = ["--cells", "layout.drones=5,timing.connection_lost_after_s=5"]
    assert main(["plot", str(results_folder), "healed_over_time", str(one), *only]) == 0
    assert len(one.read_text(encoding="utf-8")) < len(svg)
    none = ["--cells", "layout.drones=7"]
    assert main(["plot", str(results_folder), "healed_over_time", str(one), *none]) == 1
    assert "no cell matches layout.drones=7" in capsys.readouterr().err
    assert main(["plot", str(results_folder), "phase", str(out)]) == 1
    assert "no figure phase; there are " in capsys.readouterr().err
    assert main(["plot", str(results_folder), "drones", str(out), "--metric", "heald"]) == 1
    assert "runs.csv has no column heald" in capsys.readouterr().err
    assert main(["plot", str(results_folder), "phases", str(tmp_path / "no" / "x.svg")]) == 1
    assert "cannot write" in capsys.readouterr().err


def test_a_cell_whose_value_is_a_list_can_be_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    speeds = "mobility.kind: [random_waypoint]\n  mobility.speed_m_s: [1.0, [0.5, 1.0]]"
    text = HEALING.replace("layout.drones: [5, 6]", speeds)
    text = text.replace("seeds: 4", "seeds: 2").replace("duration_s: 90", "duration_s: 15")
    (tmp_path / "speeds.yaml").write_text(text)
    out = tmp_path / "results"
    assert main(["run", str(tmp_path / "speeds.yaml"), "--out", str(out), "--workers", "0"]) == 0
    cells = [f"connection_lost_after_s={s},mobility.speed_m_s=[0.5,1.0]" for s in (30, 5)]
    assert main(["compare", str(out), *(f"timing.{cell}" for cell in cells)]) == 0
    assert "speed_m_s=[0.5,1.0]" in capsys.readouterr().out


def test_tables_prints_the_tables_of_the_report_as_markdown(
    results_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tables", str(results_folder), "--only", "cells"]) == 0
    title, _, header, rule, *rows = capsys.readouterr().out.splitlines()
    assert title.startswith("Results by cell. ")
    assert header.startswith("| connection_lost_after_s | drones | n | ")
    assert set(rule) == set("|-")
    assert header.count("|") == rule.count("|") == rows[0].count("|")


def test_metrics_lists_all_of_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["metrics"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(listed()) + 1  # and the types of packets
    assert {"own_TYPE", "fwd_TYPE", "TYPE:"} < {line.split()[0] for line in lines}
