"""`python -m bayesid`: the same as the command `bayesid`."""

from bayesid.cli.entry import main

if __name__ == "__main__":
    main()
