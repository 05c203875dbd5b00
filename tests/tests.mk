# SPDX-License-Identifier: Apache-2.0
# The test targets; included by the Makefile. Every tests/unit/ROOM_*.c is one TAP program, every
# tests/e2e/*.sh one TAP script; both run under prove.

UNIT      = $(patsubst tests/unit/%.c,$(BUILD)/tests/%,$(sort $(wildcard tests/unit/*.c)))
BENCH     = $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(sort $(wildcard tests/bench/*.c)))
TEST_LIB  = $(patsubst %.c,$(BUILD)/%.o,$(sort $(wildcard tests/lib/*.c)))
TEST_DATA = $(or $(SEGMILL_TEST_DATA),../shared/data)
TEST_ENV  = BUILD=$(BUILD) SEGMILL_TEST_DATA=$(TEST_DATA)

$(BUILD)/tests/%: $(BUILD)/tests/unit/%.o $(TEST_LIB) $(LIBS)
	$(call say,LD,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(SAN) -fopenmp -o $@ $^ $(PKG_LIBS) -lm

$(BUILD)/bench/%: $(BUILD)/tests/bench/%.o $(TEST_LIB) $(LIBS)
	$(call say,LD,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(SAN) -fopenmp -o $@ $^ $(PKG_LIBS) -lm

# A judge is a program around a library that we did not write, for the tests to ask.
JUDGES = $(patsubst tests/judges/%.cc,$(BUILD)/judges/%,$(sort $(wildcard tests/judges/*.cc)))
$(BUILD)/judges/%: $(BUILD)/tests/judges/%.o
	$(call say,LD,$@)
	$(Q)mkdir -p $(@D) && $(CXX) -o $@ $^ $(OCC_LIBS)

.PHONY: unit
unit: $(UNIT) $(PROGRAMS) $(JUDGES)
	$(Q)$(TEST_ENV) prove -j2 $(UNIT)

# One room's tests, while working on it: make test-nc
.PHONY: $(addprefix test-,$(ROOMS))
$(addprefix test-,$(ROOMS)): test-%: $(PROGRAMS) $(JUDGES)
	$(Q)$(MAKE) --no-print-directory NODEPS=1 $(filter $(BUILD)/tests/$*_%,$(UNIT))
	$(Q)$(TEST_ENV) prove -j2 $(filter $(BUILD)/tests/$*_%,$(UNIT))
