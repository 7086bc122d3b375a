"""Do wheel and sdist hold every file of the package? Usage: check_distribution.py FOLDER_OF_BOTH"""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

folder = Path(sys.argv[1])
(wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
listed = subprocess.run(["git", "ls-files", "bayesid"], capture_output=True, text=True, check=True)
wanted = set(listed.stdout.split())
with zipfile.ZipFile(wheel) as file:
    in_wheel = set(file.namelist())
with tarfile.open(sdist) as archive:
    in_sdist = {name.split("/", 1)[-1] for name in archive.getnames()}
missing = {"wheel": sorted(wanted - in_wheel), "sdist": sorted(wanted - in_sdist)}
for kind, names in missing.items():
    if names:
        print(f"{kind}: {len(names)} files of the package are missing, e.g. {', '.join(names[:5])}")
if any(missing.values()):
    sys.exit(1)
print(
    f"wheel and sdist hold all {len(wanted)} files of the package ({wheel.stat().st_size / 1e6:.1f} MB wheel)"
)
