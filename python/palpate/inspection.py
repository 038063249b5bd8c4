"""Operations that look closer: contact maps, marginals, readings of a session, training reports.

They belong to `Client` and `AsyncClient` like those of `operations.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.pose import FloatArray
from palpate.steps import Document, Steps, ask, delete, get, operation, pages, same


@dataclass(frozen=True)
class ContactMap:
    """Where an object generates contact, as a grid in its frame."""

    kind: str
    """planar or solid."""
    minimum: FloatArray
    """Shape (3,): the corner with the smallest coordinates, in metres."""
    cell: float
    """Edge of a cell, in metres."""
    log_odds: FloatArray
    """Shape (n_x, n_y, n_z): ln of the odds of contact in each cell."""
    document: Document = field(repr=False)

    @property
    def probabilities(self) -> FloatArray:
        """Shape (n_x, n_y, n_z): the probability of contact in each cell."""
        result: FloatArray = 1.0 / (1.0 + np.exp(-self.log_odds))
        return result


class Inspection:
    """The operations that look closer."""

    @operation
    def contact_map(self, catalogue: str, version: int, object: str) -> Steps[ContactMap]:
        """Reads the contact map of an object: a request for each layer of its cells.

        The version must have been trained with `geometric`.
        """
        path = ("v1", "catalogues", catalogue, "versions", str(version), "objects", object)
        whole = yield from ask(get(*path, "occupancy"), same)
        n_x, n_y, n_z = whole["n_cells"]
        log_odds = np.empty((n_x, n_y, n_z))
        for layer in range(n_z):
            request = get(*path, "occupancy").with_query(slice=layer)
            shown = yield from ask(request, same)
            log_odds[:, :, layer] = np.asarray(shown["log_odds"]).reshape(n_y, n_x).T
        return ContactMap(whole["kind"], np.array(whole["min"]), whole["cell"], log_odds, whole)

    @operation
    def training_report(self, catalogue: str, version: int) -> Steps[Document]:
        """Returns what the training of a version learnt and how well it recognised."""
        return ask(get("v1", "catalogues", catalogue, "versions", str(version), "report"), same)

    @operation
    def marginals(self, session: str, *, object: str | None = None) -> Steps[Document]:
        """Returns the distribution of each coordinate of an object's pose.

        Only for methods that keep it (`geometric…`); the likeliest object's if none is named.
        """
        return ask(get("v1", "sessions", session, "marginals").with_query(object=object), same)

    @operation
    def session_readings(self, session: str) -> Steps[list[Document]]:
        """Returns all readings of a session, the withdrawn ones with the revision of that."""
        return pages(get("v1", "sessions", session, "readings"), same)

    @operation
    def retract_reading(self, session: str, number: int) -> Steps[Document]:
        """Withdraws a reading by its number: the belief becomes what it is without it."""
        request = delete("v1", "sessions", session, "readings", str(number))
        return ask(request.repeatable(), same)
