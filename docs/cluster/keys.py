"""Keys for the connections of a cluster of your own: python docs/cluster/keys.py FOLDER && source FOLDER/settings

The folder is made, closed to others, on a file system that all machines share. A scheduler, workers and a run that are
started with these settings speak TLS, and only to each other. Needs shadowbench-rt[cluster].
"""

import shlex
import sys
from pathlib import Path

from distributed.security import Security

if __name__ == "__main__":
    folder, made = Path(sys.argv[1]).resolve(), Security.temporary()
    folder.mkdir(mode=0o700, parents=True)
    files = {"key": folder / "key.pem", "cert": folder / "cert.pem"}
    files["key"].write_text(made.tls_scheduler_key)
    files["cert"].write_text(made.tls_scheduler_cert)
    settings = {"REQUIRE_ENCRYPTION": "true", "DEFAULT_SCHEME": "tls", "TLS__CA_FILE": files["cert"]}
    for role in ("SCHEDULER", "WORKER", "CLIENT"):
        settings |= {f"TLS__{role}__{what.upper()}": file for what, file in files.items()}
    lines = [f"export DASK_DISTRIBUTED__COMM__{name}={shlex.quote(str(value))}" for name, value in settings.items()]
    (folder / "settings").write_text("\n".join(lines) + "\n")
