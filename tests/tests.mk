# SPDX-License-Identifier: Apache-2.0
# The test targets; included by the Makefile. Every tests/unit/ROOM_*.c and tests/fuzz/*.c is one
# TAP program, every tests/e2e/*.sh one TAP script; prove runs them. tests/ci/*.sh are TAP scripts
# that take long or need packages unpacked: check-ci only. tests/kernel/t/*.sh are TAP scripts that
# need CAN and GPIO (docs/testing.md).

UNIT      = $(patsubst tests/unit/%.c,$(BUILD)/tests/%,$(sort $(wildcard tests/unit/*.c)))
BENCH     = $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(sort $(wildcard tests/bench/*.c)))
FUZZ      = $(patsubst tests/fuzz/%.c,$(BUILD)/fuzz/%,$(sort $(wildcard tests/fuzz/*.c)))
JUDGES    = $(patsubst tests/judges/%.cc,$(BUILD)/judges/%,$(sort $(wildcard tests/judges/*.cc)))
PARTS     = $(addprefix $(BUILD)/parts/,p0_piece.igs impeller.igs blade.igs analytic.igs \
              analytic_inch.igs analytic_metre.igs analytic.step)
TEST_LIB  = $(patsubst %.c,$(BUILD)/%.o,$(sort $(wildcard tests/lib/*.c)))
TEST_DATA = $(or $(SEGMILL_TEST_DATA),../shared/data)
PROVE     = BUILD=$(BUILD) SEGMILL_TEST_DATA=$(TEST_DATA) prove --timer
LINK      = $(Q)mkdir -p $(@D) && $(CC) $(SAN) $(LDFLAGS) -fopenmp -o $@ $^ $(PKG_LIBS) -lm

.PHONY: check
check: all  ## every quick test: under 15 minutes on two cores
	$(Q)$(SUBMAKE) style tests-built
	$(Q)$(PROVE) -j2 -e '' $(UNIT) $(FUZZ)
	$(Q)$(PROVE) -j2 -e bash tests/e2e/*.sh
	$(Q)if tests/kernel/run.sh --on-host || tests/kernel/build.sh --built >/dev/null; then \
	    $(SUBMAKE) check-kernel; \
	else \
	    echo "not run, for want of CAN and GPIO: make check-kernel (builds a kernel, once)"; \
	fi

.PHONY: check-ci
check-ci: check-asan check-clang check-mutants check-sweep check-judges check-kernel  ## the longer proofs: under 45 minutes
check-ci: export KERNEL_USE = uml
check-ci: export CAN_ALL = 1
check-ci: export CAN_CELLS = can_cell can_programs

# Open CASCADE's own leaks are suppressed by library; nothing of ours is.
.PHONY: check-asan
check-asan: ready  ## the unit tests and fuzz corpora under ASan and UBSan
	$(Q)$(SUBMAKE) BUILD=$(BUILD)/asan OPT='-O1 -g' \
	    SAN='-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer' \
	    prove-unit

# The second compiler, and its libFuzzer on every target. Sanitized loops do not vectorise, which
# is no matter here.
FUZZ_SECONDS = 20
.PHONY: check-clang
check-clang: ready
	$(Q)$(SUBMAKE) BUILD=$(BUILD)/clang CC=clang CXX=clang++ \
	    OPT='-O1 -g -Werror -Wno-pass-failed' SAN=-fsanitize=fuzzer-no-link,address,undefined \
	    FUZZ_MAIN=-fsanitize=fuzzer PROGRAMS= fuzz-run

.PHONY: check-mutants
check-mutants: all
	$(Q)$(SUBMAKE) tests-built
	$(Q)SEGMILL_MUTANTS=1000 $(PROVE) -e '' $(BUILD)/tests/segcore_mutants

# Several faults in one delivery, others each time; the seed is printed.
.PHONY: check-sweep
check-sweep: all
	$(Q)$(SUBMAKE) $(BUILD)/tests/fieldbus_faults
	$(Q)SEGMILL_SWEEP=300000 $(PROVE) -v -e '' $(BUILD)/tests/fieldbus_faults

.PHONY: check-judges
check-judges: all
	$(Q)$(SUBMAKE) tests-built
	$(Q)SEGMILL_JUDGE_EVERY=1 $(PROVE) -e '' $(BUILD)/tests/segcore_judge
	$(Q)$(PROVE) -e bash tests/ci/*.sh

# One after another: they share one processor inside.
.PHONY: check-kernel
check-kernel: all  ## CAN and GPIO: on this host if it has both, else in a kernel of their own
	$(Q)$(SUBMAKE) $(BUILD)/kernel/poweroff $(CAN_FAULTS)
	$(Q)tests/kernel/run.sh --on-host || tests/kernel/build.sh >/dev/null
	$(Q)$(PROVE) -e bash tests/kernel/outside.sh
	$(Q)$(PROVE) -e 'bash tests/kernel/run.sh' tests/kernel/t/*.sh

.PHONY: soak
soak: all  ## hours of the same: ten thousand damaged files, long fuzzing, thousands of programs
	$(Q)$(SUBMAKE) tests-built
	$(Q)SEGMILL_MUTANTS=10000 $(PROVE) -e '' $(BUILD)/tests/segcore_mutants
	$(Q)SEGMILL_SWEEP=10000000 $(PROVE) -v -e '' $(BUILD)/tests/fieldbus_faults
	$(Q)SEGMILL_SOAK=2000 $(PROVE) -e bash tests/ci/soak.sh
	$(Q)$(SUBMAKE) $(BUILD)/kernel/poweroff $(CAN_FAULTS)
	$(Q)CAN_INSIDE=1 CAN_ALL=1 CAN_CELLS='can_cell can_programs' CAN_PROGRAMS=10 \
	    KERNEL_SECONDS=10800 KERNEL_USE=uml $(PROVE) -e 'bash tests/kernel/run.sh' tests/kernel/t/can_faults.sh
	$(Q)$(MAKE) --no-print-directory check-clang FUZZ_SECONDS=1800

.PHONY: bench
bench: all  ## figures: ours, the peer's where there is one, the ratio
	$(Q)$(SUBMAKE) $(BENCH) $(PARTS)
	$(Q)for b in $(BENCH); do BUILD=$(BUILD) SEGMILL_TEST_DATA=$(TEST_DATA) $$b || exit 1; done
	$(Q)$(SUBMAKE) $(BUILD)/kernel/poweroff
	$(Q)BUILD=$(BUILD) tests/kernel/run.sh tests/kernel/bench/can.sh

.PHONY: demo
demo: all  ## the main job on a shipped part, against the virtual CNC
	$(Q)BUILD=$(BUILD) tests/demo.sh

.PHONY: style
style:  ## formatting, file length, SPDX lines, the rooms' include rules
	$(Q)tests/style.sh

# One room's tests, while working on it: make test-nc
.PHONY: $(addprefix test-,$(ROOMS) occ)
$(addprefix test-,$(ROOMS) occ): test-%: tests-built
	$(Q)$(PROVE) -e '' $(filter $(BUILD)/tests/$*_%,$(UNIT))

.PHONY: tests-built prove-unit fuzz-run
tests-built: $(PROGRAMS) $(UNIT) $(FUZZ) $(JUDGES) $(PARTS)

prove-unit: tests-built
	$(Q)$(PROVE) -j2 -e '' $(UNIT) $(FUZZ)

fuzz-run: $(LIBS) $(UNIT) $(FUZZ)
	$(Q)for f in $(FUZZ); do \
	    seeds=tests/fuzz/corpus/$$(basename $$f); found=$(BUILD)/corpus/$$(basename $$f); \
	    mkdir -p $$found; echo "fuzzing $$f for $(FUZZ_SECONDS) s"; \
	    $$f -max_total_time=$(FUZZ_SECONDS) -rss_limit_mb=4096 -print_final_stats=1 \
	        -artifact_prefix=$(BUILD)/ $$found $$seeds 2>$$found.log || \
	        { tail -n 40 $$found.log; exit 1; }; \
	done

$(BUILD)/tests/%: $(BUILD)/tests/unit/%.o $(TEST_LIB) $(LIBS)
	$(call say,LD,$@)
	$(LINK)

$(BUILD)/bench/%: $(BUILD)/tests/bench/%.o $(TEST_LIB) $(LIBS)
	$(call say,LD,$@)
	$(LINK)

# The programs in the kernel for the tests, where sanitizers cannot run: the last one there, and the
# faults on CAN, with each of its cells.
$(BUILD)/tests/kernel/%.o: override SAN =
CAN_FAULTS = $(addprefix $(BUILD)/kernel/,can_cell can_programs)
$(CAN_FAULTS): $(addprefix $(BUILD)/tests/kernel/,can_faults.o can_bridge.o) $(FIELDBUS) $(CONFIG)
$(BUILD)/kernel/%: $(BUILD)/tests/kernel/%.o
	$(call say,LD,$@)
	$(Q)mkdir -p $(@D) && $(CC) -o $@ $^ -Wl,--as-needed $(PKG_LIBS)

# A fuzz target is one LLVMFuzzerTestOneInput. By default its main is a driver that runs the corpus
# and seeded mutations of it as TAP; check-clang puts libFuzzer's in that place.
FUZZ_MAIN = $(BUILD)/tests/lib/fuzz/driver.o
$(BUILD)/fuzz/%: $(BUILD)/tests/fuzz/%.o $(filter %.o,$(FUZZ_MAIN)) $(LIBS)
	$(call say,LD,$@)
	$(LINK) $(filter-out %.o,$(FUZZ_MAIN))

# A judge is a program around a library that we did not write, for the tests to ask.
$(BUILD)/judges/%: $(BUILD)/tests/judges/%.o
	$(call say,LD,$@)
	$(Q)mkdir -p $(@D) && $(CXX) -o $@ $^ $(OCC_LIBS)

# The test parts: one program of ours writes them all, the same bytes each time.
PARTS_OBJ = $(patsubst %.cc,$(BUILD)/%.o,$(sort $(wildcard tests/parts/*.cc))) \
            $(addprefix $(BUILD)/segcore/occ/,write_iges.o cad_file.o)
$(BUILD)/parts/make_parts: $(PARTS_OBJ)
	$(call say,LD,$@)
	$(Q)mkdir -p $(@D) && $(CXX) -o $@ $^ $(OCC_LIBS) -lglib-2.0
$(PARTS) &: $(BUILD)/parts/make_parts
	$(call say,PARTS,$(@D))
	$(Q)$< $(@D)

.PHONY: papers
papers: all  ## the papers' experiments: their figures, ours, what is not reached
	$(Q)$(SUBMAKE) $(BUILD)/papers/p0 $(PARTS)
	$(Q)BUILD=$(BUILD) $(BUILD)/papers/p0

$(BUILD)/papers/%: $(BUILD)/tests/papers/%.o $(TEST_LIB) $(LIBS)
	$(call say,LD,$@)
	$(LINK)
