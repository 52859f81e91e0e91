"""Errors of proof files. Such a file is broken or was tampered with, and its holder can do one thing about it, whatever is wrong.

So ``ciris verify`` names the file and says what to do, once for all of these. The tests of ``certifier/verify`` provoke them one by one.
"""

from __future__ import annotations

from client.verify import REFUSED, UNCHECKED
from tests.errors.rows import Row

BROKEN = "a proof file that was changed"


def proofs(module: str, *errors: tuple[str, str]) -> list[Row]:
    """Returns the rows of a module: code and message."""
    return [Row(module, code, "PROOF", message, UNCHECKED if code == "proof_too_large" else REFUSED, BROKEN) for code, message in errors]


PROOFS: list[Row] = [
    *proofs(
        "certifier/document.py",
        ("document", "it is nested too deeply"),
        ("document", "it is not JSON: {error}"),
        ("document", "an object"),
        ("document", "{name} is missing"),
        ("document", "{...} has no meaning here"),
        ("document", "a list"),
        ("document", "there are {...} of them, at most {most} are read"),
        ("document", "a list of two"),
        ("document", "a text"),
        ("document", "a whole number from 0"),
        ("document", "a number of at most {LARGEST} that a double holds"),
        ("document", "it holds a number that is not finite"),
        ("document", "it is nested more than {MAX_NESTING} levels deep"),
        ("document", "a list of numbers"),
        ("document", "a list of {...}"),
    ),
    *proofs(
        "certifier/proof/container.py",
        ("proof_malformed", "the proof file is malformed: {problem}"),
        ("proof_too_large", "the proof file has {...} bytes, more than {FILE_BYTES}"),
        ("proof_too_large", "the proof file has more than {MEMBERS} members, or too long names"),
        ("proof_too_large", "the proof file unpacks to {total} bytes, more than {most}"),
        ("proof_too_large", "the header has {file_size} bytes, more than {HEADER_BYTES}"),
    ),
    *proofs(
        "certifier/proof/negative.py",
        ("document", "it is {shape}, not (K, 3)"),
    ),
    *proofs(
        "certifier/proof/pair.py",
        ("document", "it is {shape}, not (2,)"),
    ),
    *proofs(
        "certifier/proof/region.py",
        ("document", "it is {shape}, not a number"),
    ),
    *proofs(
        "certifier/proof/separation.py",
        ("document", "a pair's file holds one proof, not {...}"),
        ("document", "there are {count} of them, at most {GROUNDS} are read"),
        ("document", "a polytope or a volume of it belongs to no proof"),
        ("document", "{...} is no form of proof that belongs here"),
        ("document", "it has no vertices, more than {CORNERS} or no radius"),
        ("document", "a volume without a body is one geometry"),
        ("document", "there is no number {number}, only {...}"),
        ("proof_scene", "the proof is about another scene"),
    ),
    *proofs(
        "certifier/verify/coarse.py",
        ("proof_volume", "a coarse volume is neither a ball nor a capsule"),
        ("proof_volume", "{name} is not behind revolute joints of {body}, to which its coarse volume is fixed"),
        ("proof_volume", "{name} is behind {...} joints of the body to which its coarse capsule is fixed"),
        ("proof_volume", "{name} may leave the coarse volume that stands for it"),
    ),
    *proofs(
        "certifier/verify/dual.py",
        ("proof_pair", "the proof is about no pair, or no body, of the scene"),
        ("proof_box", "the box of a dual proof reaches beyond the limits of {name}"),
        ("proof_dual", "the functionals have no mass"),
        ("proof_dual", "the equations are not met: {slack}"),
        ("proof_malformed", "the equations and the moments that meet them do not fit"),
        ("proof_dual", "the equations cannot be met by the moments named"),
        ("proof_malformed", "the proof names a moment that is not there"),
        ("proof_malformed", "the matrices that concern the normal do not fit"),
        ("proof_dual", "the matrix that concerns the normal has a diagonal entry larger than its first"),
        ("proof_dual", "the matrix that concerns the normal is too large"),
        ("proof_malformed", "the moments of {...} do not fit"),
        ("proof_too_large", "a body has {size} moments; at most {MOMENTS} are checked"),
        ("proof_too_large", "a body's localising matrices have more than {LOCALISED} entries"),
        ("proof_dual", "a localising matrix has no positive diagonal"),
        ("proof_dual", "a localising matrix is not positive definite"),
    ),
    *proofs(
        "certifier/verify/file.py",
        ("proof_malformed", "the file is a proof of kind {...}, which is none"),
        ("proof_without_scene", "the file names its scene by its hash and does not carry it"),
        ("proof_region", "the proof is about another region"),
        ("no_file", "{...}"),
    ),
    *proofs(
        "certifier/verify/limbs.py",
        ("proof_too_large", "sums of {...} products, more than {MAX_TERMS}"),
    ),
    *proofs(
        "certifier/verify/pair.py",
        ("proof_too_large", "a polytope has {m} faces; at most {FACES} are checked"),
        ("proof_malformed", "{name} of a polytope is {shape}, not {shape}"),
        ("proof_box", "the box of a polytope is empty"),
        ("proof_box", "the box of a polytope cannot be represented"),
        ("proof_box", "the multipliers do not prove the box around the polytope"),
        ("proof_interior", "the point that should show that the polytope is not empty is not in it"),
        ("proof_scene", "the proof is about another scene"),
        ("proof_pair", "{title} are not a pair of the scene"),
        ("proof_frame", "the scene has no body {frame}"),
        ("proof_malformed", "the proof uses a face that is not there"),
        ("proof_malformed", "the plane has the wrong shape"),
        ("proof_margin", "the margin is not positive"),
        ("proof_norm", "the plane has no normal: it separates nothing, were the polytope not empty"),
        ("proof_norm", "kappa does not bound the plane's normal"),
        ("proof_residual", "{title}: {eaten}"),
        ("proof_too_large", "the Gram matrices of a vertex have {entries} entries; at most {FACTORS} are checked"),
        ("proof_malformed", "the Gram factors of {...} do not fit"),
        ("proof_too_large", "more than {MAX_CORNER_JOINTS} joints"),
    ),
    *proofs(
        "certifier/verify/partition.py",
        ("proof_scene", "the proof is about another scene"),
        ("proof_pair", "{title} are not a pair of the scene"),
        ("proof_frame", "the scene has no body {frame}"),
        ("proof_volume", "{title}: a coarse volume has other geometries than the one that it stands for"),
        ("proof_too_large", "{title}: {...} joints in play; at most {most} are checked"),
        ("proof_too_large", "{title}: a piece is halved more than {most} times"),
        ("proof_cell", "{title}: {where}: {why}"),
    ),
    *proofs(
        "certifier/verify/region.py",
        ("proof_pairs", "no proof covers the pair {a} and {b}"),
        ("proof_too_large", "the region has more than {FACES} half-spaces, or implies more"),
        ("proof_malformed", "the region's arrays do not fit the scene"),
        ("proof_limits", "the joint limits are not among the region's half-spaces"),
        ("proof_interior", "the interior point is not within the joint limits"),
        ("proof_interior", "the interior point is not strictly inside the region"),
        ("proof_archimedean", "the multipliers do not prove the region Archimedean"),
        ("proof_malformed", "the implied half-spaces do not fit the region"),
        ("proof_implied", "the multipliers do not prove a half-space around the region"),
        ("proof_ground", "a pair's proof is about a polytope that does not contain the region"),
    ),
    *proofs(
        "certifier/verify/residual.py",
        ("proof_too_large", "more than {MAX_CHAIN} joints between {frame} and {body}"),
        ("proof_malformed", "the Gram factors of {...} do not fit"),
        ("proof_malformed", "a Gram factor is out of range"),
    ),
    *proofs(
        "certifier/verify/scene.py",
        ("proof_model", "the model of the proof makes no sense: {problem}"),
        ("proof_too_large", "the model of the proof has {number} {what}; at most {most} are checked"),
    ),
    *proofs(
        "certifier/verify/separations.py",
        ("proof_malformed", "{title}: a proof of kind {KIND} cannot be checked"),
        ("proof_interior", "{title}: the proof says that the polytope is empty"),
        ("{...}", "{...}"),
    ),
    *proofs(
        "certifier/verify/streams.py",
        ("proof_malformed", "{title}: {problem}"),
        ("proof_too_large", "{title}: {...} nodes; at most {NODES} are checked"),
        ("proof_too_large", "{title}: a cell is cut more than {CUT_DEPTH} times"),
        ("proof_too_large", "{title}: {...} nodes of pieces; at most {PIECES} are checked"),
        ("proof_too_large", "{title}: a vertex has more than {TREE} nodes of pieces"),
    ),
    *proofs(
        "certifier/verify/volume.py",
        ("proof_too_large", "the proof's volumes stand for more vertices, behind more joints, than are checked"),
        ("proof_volume", "{name} is not contained in the volume that stands for it"),
        ("proof_volume", "a volume stands for nothing, or for what is no geometry of the scene"),
        ("proof_malformed", "a volume has no vertices, or numbers that are no lengths"),
        ("proof_volume", "the scene has no body {body}"),
        ("proof_volume", "{name} is not welded to {body}"),
    ),
    *proofs(
        "certifier/verify/witness.py",
        ("proof_malformed", "the arrays of the witness do not fit the scene"),
        ("proof_pair", "{a} and {b} are not a pair of the scene"),
        ("proof_witness", "the configuration is not in the polytope, or not within the joint limits"),
        ("proof_witness", "{name} and {name} do not touch at the configuration"),
        ("proof_malformed", "the weights of the witness are no convex weights"),
    ),
]
