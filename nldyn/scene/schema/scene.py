"""The whole of a scene file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import PrivateAttr

from nldyn.scene.schema.computation import (
    ContinuationTable,
    ExploreTable,
    ObserveTable,
    SeedTable,
    StartTable,
)
from nldyn.scene.schema.connections import (
    DamperTable,
    DampingTable,
    FrictionTable,
    MeshSpringTable,
    SpringTable,
)
from nldyn.scene.schema.contacts import AnyAreaTable, AnyStopTable, RoundClearanceTable
from nldyn.scene.schema.loads import AnyExcitationTable
from nldyn.scene.schema.structures import ComponentTable, JointTable, ModalTable, StructureTables
from nldyn.system.naming import is_angle

STEADY = ("constant", "weight")  # kinds of loads that do not change in time


class Scene(StructureTables):
    """A whole scene: a structure, what acts on it, and what to compute.

    Read one with `nldyn.scene.load_scene`. Units are SI; keys that end in ``_hz`` are in Hz.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> scene = load_scene(example("one_dof.toml"))
    >>> scene.stops[0].stiffness
    5170000000.0
    """

    title: str = ""
    """Title of the diagram."""
    modal: ModalTable | None = None
    components: dict[str, ComponentTable] = {}
    joints: list[JointTable] = []
    damping: DampingTable = DampingTable()
    dampers: list[DamperTable] = []
    stops: list[AnyStopTable] = []
    round_clearances: list[RoundClearanceTable] = []
    contact_areas: list[AnyAreaTable] = []
    friction: list[FrictionTable] = []
    excitation: list[AnyExcitationTable] = []
    observe: ObserveTable | None = None
    start: StartTable | None = None
    continuation: ContinuationTable | None = None
    subharmonics: list[SeedTable] = []
    explore: ExploreTable | None = None

    _file: Path = PrivateAttr(default=Path("scene.toml"))
    _text: str = PrivateAttr(default="")
    _mesh_folders: tuple[Path, ...] = PrivateAttr(default=())
    _areas_found: Any = PrivateAttr(default=None)  # what `nldyn.scene.contact` found in the mesh

    @property
    def file(self) -> Path:
        """Where the scene was read from."""
        return self._file

    @property
    def text(self) -> str:
        """The text of the file, word for word."""
        return self._text

    @property
    def mesh_folders(self) -> tuple[Path, ...]:
        """Folders below which the mesh may be: of the scene, the current one, and further ones."""
        return self._mesh_folders

    @property
    def mesh_springs(self) -> dict[int, MeshSpringTable]:
        """The springs that belong to the mesh, by their numbers in the file."""
        return {n: each for n, each in enumerate(self.springs) if isinstance(each, MeshSpringTable)}

    @property
    def interface_springs(self) -> dict[int, SpringTable]:
        """The others, which act at interfaces."""
        return {n: each for n, each in enumerate(self.springs) if isinstance(each, SpringTable)}

    @property
    def ties(self) -> Iterator[tuple[str, int, str, str]]:
        """Table, number in it and both interfaces of all that lies between two."""
        for table in ("stops", "friction", "springs", "dampers", "round_clearances"):
            for number, element in enumerate(getattr(self, table)):
                for at, against in element.ends:
                    if against is not None:
                        yield table, number, at, against

    @property
    def driven(self) -> bool:
        """Whether a load moves the structure."""
        return any(table.kind not in STEADY for table in self.excitation)

    @property
    def self_excited(self) -> bool:
        """Whether motions are to be followed over a parameter that no load moves."""
        return not self.driven and bool(self.continuation and self.continuation.parameter)

    @property
    def interface_names(self) -> list[str]:
        """Names of the interfaces, in the order of the file."""
        if self.modal is not None:
            return list(self.modal.participation)
        if self.matrices is not None:
            return list(self.matrices.interfaces)
        if self.components:
            parts = self.component_scenes.items()
            return [f"{name}.{at}" for name, part in parts for at in part.interface_names]
        return list(self.interfaces)

    def direction_at(self, interface: str) -> str:
        """The direction of an interface; empty where none is told."""
        part, name = self, interface
        if self.components:
            component, _, name = interface.partition(".")
            part = self.component_scenes[component]
        given = part.matrices.interfaces if part.matrices is not None else part.interfaces
        return getattr(given.get(name), "direction", None) or ""

    @property
    def rotations(self) -> frozenset[str]:
        """The interfaces that turn."""
        return frozenset(name for name in self.interface_names if is_angle(self.direction_at(name)))

    @property
    def load_names(self) -> list[str]:
        """Names of the load vectors that are given with modes or matrices."""
        if self.components:
            parts = self.component_scenes.items()
            return [f"{name}.{load}" for name, part in parts for load in part.load_names]
        given = self.modal or self.matrices
        return list(given.loads) if given else []

    @property
    def component_scenes(self) -> dict[str, Scene]:
        """A scene for each component, with what acts on the whole of it."""
        on_all = [table for table in self.excitation if table.load is not None]
        return {name: self._of_component(table, on_all) for name, table in self.components.items()}

    def _of_component(self, table: ComponentTable, on_all: list[AnyExcitationTable]) -> Scene:
        tables = {name: getattr(table, name) for name in ComponentTable.model_fields}
        part = Scene(**tables, excitation=on_all)
        part._file, part._mesh_folders = self._file, self._mesh_folders
        return part

    @property
    def observed(self) -> str:
        """The interface whose displacement is reported: ``observe.at``, else the first one."""
        return self.observe.at if self.observe else self.interface_names[0]
