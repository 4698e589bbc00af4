"""``python -m rigident``: the command line."""

from rigident._command_line import main

if __name__ == "__main__":
    main()
