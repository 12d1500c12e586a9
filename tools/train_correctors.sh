#!/bin/sh
# Trains every shipped corrector of the affine family anew: needed after each change of a turbine's equations, parameters or tables.
set -e
cd "$(dirname "$0")/.."
for recipe in $(grep -l '^family: affine' correctors/*.yaml); do
    echo "$recipe"
    fatigue-runner train "$recipe"
done
