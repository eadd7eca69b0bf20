"""The default agent: `python -m tractrix.train --out DIR` is `python -m tractrix.train.rollout`."""

from tractrix.train.rollout import main

if __name__ == "__main__":
    main()
