"""``python -m shadowbench``: the command of the same name."""

from shadowbench.harness.cli import main

if __name__ == "__main__":
    main()
