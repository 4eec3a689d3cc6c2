"""3MF files, written part by part."""

import zipfile

from helpers import mesh_files as files

from .mesh_files import zipped

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONSHIPS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/model.model" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>"
)


def mesh(number, points=files.QUAD, triangles=files.FACES) -> str:
    """An object of triangles."""
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in points.tolist())
    corners = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    inside = f"<vertices>{vertices}</vertices><triangles>{corners}</triangles>"
    return f'<object id="{number}"><mesh>{inside}</mesh></object>'


def group(number, *uses) -> str:
    """An object of components."""
    return f'<object id="{number}"><components>{"".join(uses)}</components></object>'


def use(number, move=None, tag="component", path=None) -> str:
    """A component or an item; ``move``: the last row of its transform, or all twelve numbers."""
    numbers = [1, 0, 0, 0, 1, 0, 0, 0, 1, *move] if move is not None and len(move) == 3 else move
    transform = f' transform="{" ".join(map(str, numbers))}"' if numbers is not None else ""
    return f'<{tag} objectid="{number}"{transform}{f" p:path={path!r}" if path else ""}/>'


def item(number, move=None, path=None) -> str:
    return use(number, move, "item", path)


def model(objects, *build, more="") -> str:
    head = f'<?xml version="1.0"?>\n<model unit="millimeter" xmlns="{CORE}" xmlns:p="{PRODUCTION}" {more}>'
    return f"{head}<resources>{''.join(objects)}</resources><build>{''.join(build)}</build></model>"


def package(text, stored=zipfile.ZIP_DEFLATED, **parts) -> bytes:
    """A package with a model, and other parts by their names in 3D/."""
    models = {f"3D/{name}.model": content for name, content in {"model": text, **parts}.items()}
    return zipped({"_rels/.rels": RELATIONSHIPS, **models}, stored)


def quad() -> bytes:
    """The square of the other formats."""
    return package(model([mesh(1)], item(1)))
