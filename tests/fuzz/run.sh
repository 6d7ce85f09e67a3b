#!/usr/bin/env bash
# Fuzzes with libFuzzer (clang), AddressSanitizer and UndefinedBehaviorSanitizer: every target, one after the other.
#   tests/fuzz/run.sh [SECONDS] [TARGET...]      SECONDS of each target (default 60); targets: reader, octomap, ...
# What is learnt is kept in build/fuzz/corpus; what crashes is left in build/fuzz/finds. Exits with 1 on a find.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/../.."
seconds=${1:-60}
shift || true
targets=("$@")
# APGM_FUZZ_BUILD: a build that is made already. APGM_FUZZ_SEEDS: seeds that another build made; the program that makes
# them needs all converters.
build=${APGM_FUZZ_BUILD:-build/fuzz}
if [ -z "${APGM_FUZZ_BUILD:-}" ]; then
  cmake --preset fuzz >/dev/null
  programs=("${targets[@]/#/fuzz_}")
  [ ${#targets[@]} -eq 0 ] || [ -n "${APGM_FUZZ_SEEDS:-}" ] || programs+=(make-fuzz-seeds)
  [ ${#targets[@]} -gt 0 ] || programs=(fuzz)
  cmake --build --preset fuzz --target "${programs[@]}"
fi
seeds=${APGM_FUZZ_SEEDS:-$build/tests/fuzz/seeds}
[ -n "${APGM_FUZZ_SEEDS:-}" ] || "$build/bin/make-fuzz-seeds" tests/conformance/v1 "$seeds"
[ ${#targets[@]} -gt 0 ] || mapfile -t targets < <(find "$build/bin" -maxdepth 1 -name 'fuzz_*' -printf '%f\n' | sed 's/^fuzz_//' | sort)
mkdir -p "$build/finds"
# Readers that take names of files are given files: in memory, where there is such a directory.
[ -w /dev/shm ] && export TMPDIR=/dev/shm
# Freed memory is kept from use for a while, and must not count as needed.
export ASAN_OPTIONS=quarantine_size_mb=8:malloc_context_size=8:allocator_may_return_null=0
# APGM_FUZZ_SEED: the same mutations in each run.
again=()
[ -z "${APGM_FUZZ_SEED:-}" ] || again=("-seed=$APGM_FUZZ_SEED")
status=0
for target in "${targets[@]}"; do
  mkdir -p "$build/corpus/$target"
  from=("$build/corpus/$target")
  for dir in "$seeds/$target" "$here/seeds/$target" "$here/finds/$target"; do
    [ ! -d "$dir" ] || from+=("$dir")
  done
  case $target in
    message | archive) from+=("$seeds/reader") ;;
    verify | recover) from+=("$seeds/reader" "$seeds/archive") ;;
  esac
  log=$build/finds/$target.log
  if "$build/bin/fuzz_$target" -max_total_time="$seconds" "${again[@]}" -timeout=60 -rss_limit_mb=512 -max_len=32768 \
      -print_final_stats=1 -artifact_prefix="$build/finds/$target-" "${from[@]}" 2>"$log"; then
    result=ok
  else
    result="FIND: $log" status=1
  fi
  # Of the last lines: #RUNS ... cov: EDGES ft: FEATURES ...
  printf '%-12s %s %s\n' "$target" \
    "$(grep -aoE '^#[0-9]+[[:space:]]+[A-Z]+ +cov: [0-9]+ ft: [0-9]+' "$log" | tail -1 | tr -s '[:space:]' ' ')" "$result"
done
exit "$status"
