"""A stage and the files that it is composed of: nothing missing in silence, nothing printed by USD's library."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pxr import Ar, Tf, Usd, UsdUtils

from ..checks import broken

_LOADED = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
_LEAVE_OUT = "add what is missing, or give --allow-missing to leave it out"


@contextmanager
def listening(path: Path, notes: list[str]) -> Iterator[None]:
    """Keep what USD's library warns of from stderr, and note it; its errors are one line that names the file."""
    # While a delegate exists, the library tells it and prints nothing.
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except (Tf.ErrorException, Tf.CppException) as error:
        first = getattr(error.args[0], "commentary", "damaged") if error.args else "damaged"
        raise broken(path, f"USD cannot read it: {_plain(first, path)[:200]}") from None
    except UnicodeDecodeError:
        raise broken(path, "USD cannot read it: it holds text that is not UTF-8") from None
    finally:
        heard = {_plain(found.commentary, path) for found in delegate.TakeUncoalescedDiagnostics()}
    # What could not be composed is noted apart. Several threads warn in any order.
    said = sorted(text for text in heard if "instantiating stage" not in text)
    if said:
        more = f" ({len(said) - 1} more)" if len(said) > 1 else ""
        notes.append(f"USD warns: {said[0][:160]}{more}")


def opened(path: Path, allow_missing: bool, notes: list[str]) -> Any:
    """The stage of a file, all its payloads loaded.

    Raises :class:`UserError` for a reference, payload, sublayer or clip that cannot be opened or found; with
    ``allow_missing`` it is noted and left out.
    """
    stage = Usd.Stage.Open(str(path))
    lost = sorted({_plain(str(error), path) for error in stage.GetCompositionErrors()})
    lost += _missing_clips(stage, path)
    if lost and not allow_missing:
        more = f" (and {len(lost) - 1} more)" if len(lost) > 1 else ""
        raise broken(path, lost[0][:250] + more, _LEAVE_OUT)
    notes += [f"left out: {text}" for text in lost[:3]]
    if len(lost) > 3:
        notes.append(f"{len(lost) - 3} more left out")
    return stage


def layer_files(stage: Any, path: Path) -> tuple[Path, ...]:
    """The files that were read beside ``path``: of references, payloads, sublayers and value clips. Sorted.

    A layer within a package counts as the package. Clips are those of the times that were read.
    """
    names = {Ar.SplitPackageRelativePathOuter(layer.realPath)[0] for layer in stage.GetUsedLayers()}
    root = path.resolve()
    return tuple(Path(name) for name in sorted(names) if name and Path(name).resolve() != root)


def _missing_clips(stage: Any, path: Path) -> list[str]:
    """Value clips that are named and not there: USD has no value at their times."""
    lost = []
    for prim in stage.Traverse(_LOADED):
        if not prim.HasAuthoredMetadata("clips"):
            continue
        clips = Usd.ClipsAPI(prim)
        for name in clips.GetClips():
            for asset in clips.GetClipAssetPaths(name) or ():
                if not asset.resolvedPath:
                    lost.append(_plain(f"Could not open clip {asset.path} of <{prim.GetPath()}>", path))
    return sorted(set(lost))


def _plain(text: str, path: Path) -> str:
    """A message of USD's on one line, without the folder of the file, addresses in memory and marks of layers."""
    text = " ".join(text.split())
    text = re.sub(r" \(instantiating stage on stage .*\)$", " (instantiating stage)", text)
    text = re.sub(r",?@?anon:0x[^@]*@|<0x[0-9a-f]+>|( matching)? pxrInternal\S*", "", text)
    for folder in (path.absolute().parent, path.resolve().parent):
        text = text.replace(f"{folder}/", "")
    return text.replace("@", "").rstrip(".; ")
