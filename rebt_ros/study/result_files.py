"""A directory of results, to which a run that was stopped comes back.

``run.json`` says which settings and versions the results are of, ``results/NAME.json`` is
the result of one configuration.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.text import read_text
from rebt_ros.study.configurations import digest
from rebt_ros.study.provenance import fingerprint, provenance
from rebt_ros.study.results import ConfigurationResult, decoded, encoded
from rebt_ros.study.settings import Settings
from rebt_ros.study.simulator.configuration import ExperimentConfig

#: Another name than people give to directories of configurations.
_RESULTS = "results"


class ResultFiles:
    """Reads and writes the results of one experiment.

    Args:
        directory: Made if need be.
        settings: Of the experiment.

    Raises:
        OptionError: It holds results of other settings or versions.
        StorageError: It cannot be written.
    """

    def __init__(self, directory: Path, settings: Settings) -> None:
        self._results = directory / _RESULTS
        self._fingerprint = fingerprint(settings)
        run = directory / "run.json"
        mine = provenance(settings)
        if run.exists():
            _refuse_others(run, mine)
        else:
            write_text_atomically(run, json.dumps(mine, indent=1) + "\n")

    def finished(self, config: ExperimentConfig) -> ConfigurationResult | None:
        """The result of a configuration; None where it has not been run as it is now.

        Raises:
            InputError: A file of that name is something else.
        """
        path = self._path(config.name)
        if not path.exists():
            return None
        result = decoded(read_text(path), str(path))
        same = (result.configuration, result.digest, result.fingerprint)
        return result if same == (config.name, digest(config), self._fingerprint) else None

    def write(self, result: ConfigurationResult) -> None:
        """Writes a result.

        Raises:
            OptionError: It was made with other settings or versions.
            StorageError: It cannot be written.
        """
        if result.fingerprint != self._fingerprint:
            raise OptionError(
                f"{result.configuration} was run by a worker with other versions of Python, of "
                "rebt_ros or of the packages that it uses: install the same everywhere."
            )
        write_text_atomically(self._path(result.configuration), encoded(result))

    def _path(self, configuration: str) -> Path:
        return self._results / f"{configuration}.json"


def _refuse_others(run: Path, mine: Mapping[str, Any]) -> None:
    try:
        theirs = json.loads(read_text(run))
        differing = list(_differences(theirs, mine))
    except (ValueError, TypeError, AttributeError, RecursionError) as err:
        raise InputError(f"{run} is no file of an experiment: name another directory.") from err
    if differing:
        raise OptionError(
            f"{run.parent} holds results of other options or versions ({', '.join(differing)}): "
            "name another directory, or delete this one."
        )


def _differences(theirs: Mapping[str, Any], mine: Mapping[str, Any]) -> Iterator[str]:
    for part in mine:
        there, here = theirs.get(part, {}), mine[part]
        for name in sorted({*there, *here}):
            if there.get(name) != here.get(name):
                yield f"{name} {there.get(name)} instead of {here.get(name)}"
