"""The page about meshes of one's own is run as it stands."""

import re
from pathlib import Path

import numpy as np
import pytest

import contactopt
from contactopt import InputError
from contactopt.cli import main

PAGE = (Path(__file__).parents[1] / "experiments" / "site" / "your_own_mesh.md").read_text()


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", PAGE, re.S)


@pytest.mark.slow
def test_the_page_runs_from_gmsh_to_the_pressure(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mesh, solve = blocks("python")
    exec(compile(mesh, "your_own_mesh.md", "exec"), {})
    scene = blocks("toml")[0]
    Path("press-fit.toml").write_text(scene)
    (command,) = blocks("sh")
    assert main(command.split()[1:]) == 0
    assert {"pressure.png", "summary.json", "shaft.vtu", "hub.vtu"} <= {
        path.name for path in Path("out/press-fit").iterdir()
    }
    capsys.readouterr()
    names = {}
    exec(compile(solve, "your_own_mesh.md", "exec"), names)
    status, found, exact = capsys.readouterr().out.split()
    assert status == "solved" and float(found) == pytest.approx(float(exact), rel=5e-3)
    inner = names["result"].pressure[2:-2]
    assert np.abs(inner / float(exact) - 1).max() < 0.03
    for line, (right, wrong) in zip(
        blocks("text")[0].splitlines(),
        (('contact = "outer"', 'contact = "outside"'), ('"shaft"\nunit', '"axle"\nunit')),
    ):
        Path("press-fit.toml").write_text(scene.replace(right, wrong))
        with pytest.raises(InputError) as caught:
            contactopt.run("press-fit.toml")
        assert str(caught.value) == line
