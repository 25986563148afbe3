"""A reduced model as the blob that the board reads in place from flash (gravcomp_hw/firmware/standalone/model.h)."""

import struct
import zlib
from collections.abc import Sequence

import numpy as np

from gravcomp.cache import content_key
from gravcomp.description import Robot
from gravcomp.firmware.model_settings import SAMPLE_PERIOD
from gravcomp.full_model.viscosity import branch
from gravcomp.materials.laws import LAWS
from gravcomp.reduction.law_deviation import LawDeviation
from gravcomp.reduction.reduced_model import ReducedModel

MAGIC, VERSION = b"GCMB", 3
TILE = 4
SETTINGS = 77  # floats of gc_settings
MODES_MAX, STRAINS_MAX, PIECES_MAX, POINTS_MAX, LAW_POINTS_MAX = 48, 96, 512, 64, 128
LAW_FLOATS, BRANCH_FLOATS = 6, 3
_HEADER = struct.Struct("<4sIII16s8I")
_IDENTITY = 1e-5  # largest difference of the linear strains from the coordinates; more is another kind of basis


def robot_digest(robot: Robot) -> bytes:
    """Return 16 bytes that say which robot a blob belongs to: its description, whatever the basis of the reduced model."""
    return bytes.fromhex(content_key(robot))


def pack(
    model: ReducedModel,
    robot: Robot,
    settings: np.ndarray,
    least_tension: np.ndarray,
    branches: Sequence[tuple[float, float]],
) -> bytes:
    """Return the blob.

    model: with a multiple of four modes; settings (n,): of `model_settings.settings`; least_tension (m,) in N; branches: of
    `description.Material`, the same in the whole robot. Raises ValueError for a model that the blob cannot hold, which
    `model_fit` finds out before.
    """
    modes, cables = model.size, model.cables
    linear, quadratic = model.elasticity.linear, model.elasticity.quadratic
    if modes % TILE or np.abs(linear[:, :modes] - np.eye(modes)).max() > _IDENTITY:
        raise ValueError(f"a basis of {modes} modes whose linear strains are not the coordinates; a multiple of {TILE} is needed")
    missing = -linear.shape[1] % TILE
    tables = (
        _by_tiles(np.pad(quadratic, ((0, 0), (0, missing))), modes),
        _cable_stiffness(model)[:, _tile_order(modes)].T,
        cables.change.transpose(2, 1, 0),
        model.weight.T,
        model.section_change[-1].reshape(9, modes),
        model.section_rest[-1],
        cables.rest.T,
        model.section_change[:-1, 0],
        model.section_rest[:-1, 0],
        cables.rest_length,
        cables.axial_compliance,
        cables.friction,
        cables.sheath_angle,
        cables.free_length,
        least_tension,
        model.deviation.gradient.reshape(modes, 9, -1).transpose(2, 0, 1),
        law_constants(model.deviation),
        _branch_table(branches),
        settings,
    )
    count = len(cables.cable)
    body = b"".join(np.ascontiguousarray(table, dtype="<f4").tobytes() for table in tables)
    body += cables.cable.astype("u1").tobytes() + bytes(-count % 4)
    points = len(model.section_rest) - 1
    counts = (
        modes,
        linear.shape[1] + missing,
        len(cables.rest_length),
        count,
        len(settings),
        points,
        len(model.deviation.weight),
        len(branches),
    )
    header = _HEADER.pack(MAGIC, VERSION, _HEADER.size + len(body), 0, robot_digest(robot), *counts)
    return with_crc(header + body)


def law_constants(deviation: LawDeviation) -> np.ndarray:
    """Return the constants (p, 6) of gc_law: weight times lambda, mu, c10, c20, c30 and c01 in Pa."""
    rows = np.zeros((len(deviation.weight), LAW_FLOATS))
    for row, weight, law, constants in zip(rows, deviation.weight, deviation.law, deviation.constants):
        c10 = 0.5 * constants[1]
        if law == LAWS["mooney_rivlin"].code:
            c10 /= 1.0 + constants[2]
            row[5] = constants[2] * c10
        elif law == LAWS["yeoh"].code:
            row[3:5] = c10 * constants[2:4]
        row[:3] = constants[0], constants[1], c10
        row *= weight
    return rows


def with_crc(blob: bytes) -> bytes:
    """Return the blob with the CRC of its content."""
    return blob[:12] + struct.pack("<I", zlib.crc32(blob[16:])) + blob[16:]


def blob_bytes(modes: int, strains: int, cables: int, pieces: int, points: int, law_points: int, branches: int) -> int:
    """Return the number of bytes of a blob with these counts."""
    floats = modes * (modes + 1) // 2 * (strains + cables) + 3 * pieces * modes + 12 * modes + 9 + 3 * pieces
    floats += 3 * points * (modes + 1) + 6 * cables + SETTINGS
    floats += law_points * (9 * modes + LAW_FLOATS) + branches * BRANCH_FLOATS
    return _HEADER.size + 4 * floats + -(-pieces // 4) * 4


def _branch_table(branches: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return ratio, decay and gain (b, 3) of the branches over the time between two steps."""
    ratio, time = np.array(branches, dtype=float).reshape(-1, 2).T
    return np.column_stack([ratio, *branch(SAMPLE_PERIOD, time)])


def _cable_stiffness(model: ReducedModel) -> np.ndarray:
    """Return the stiffness (m, r (r + 1) / 2) of each cable under unit tension at rest, without the part along its pieces."""
    cables, modes = model.cables, model.size
    change = (cables.change / np.sqrt(np.linalg.norm(cables.rest, axis=0))).transpose(2, 1, 0)
    whole = np.zeros((len(cables.rest_length), modes, modes))
    for i in range(len(whole)):
        rows = change[cables.cable == i].reshape(-1, modes)
        whole[i] = rows.T @ rows
    return whole[(slice(None), *np.tril_indices(modes))]


def _by_tiles(quadratic: np.ndarray, modes: int) -> np.ndarray:
    """Return B^T (r (r + 1) / 2, k), its rows in the order of the tiles, by blocks of four strains."""
    order = _tile_order(modes)
    return quadratic[order].reshape(len(order), -1, TILE).transpose(1, 0, 2)


def _tile_order(modes: int) -> list[int]:
    """Return the positions, row by row in a lower triangle, of the entries in the order of the tiles."""
    order = []
    for first in range(0, modes, TILE):
        rows = range(first, first + TILE)
        order += [i * (i + 1) // 2 + j for j in range(first) for i in rows]
        order += [i * (i + 1) // 2 + j for i in rows for j in range(first, i + 1)]
    return order
