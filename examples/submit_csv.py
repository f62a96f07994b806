"""Submit a CSV file of prompts and fetch the motions.

    python examples/submit_csv.py prompts.csv clips

The server and the key come from MAREY_SERVER and MAREY_KEY, or from the `marey serve` of this machine.
"""

import sys

from marey.client import Client, InvalidItems


def main(file: str, folder: str) -> int:
    with Client() as client:
        try:
            job = client.jobs.submit_file(file, name="from a CSV", seconds=2.0)
        except InvalidItems as error:
            for problem in error.problems:
                print(f"line {problem.line}: {problem.field}: {problem.message}", file=sys.stderr)
            return error.exit_code
        client.jobs.wait(job, timeout=600)
        for fetched in client.jobs.fetch(job, folder, formats=["bvh"]):
            print(fetched.item.seed, fetched.files["bvh"])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
