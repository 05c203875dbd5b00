# SPDX-License-Identifier: Apache-2.0
# segmill's one Makefile. `make help` lists the targets; V=1 shows the commands.

BUILD  ?= build
PREFIX ?= /usr/local
V      ?= 0
Q       := $(if $(filter 1,$(V)),,@)
say      = $(if $(filter 1,$(V)),,@printf '  %-7s %s\n' $(1) $(patsubst $(BUILD)/%,%,$(2)))

CC      ?= gcc
CXX     ?= g++
OPT     ?= -O2 -g
SAN     ?=
WARN     = -Wall -Wextra -Wshadow -Wconversion
# No fused operations: every machine finds the same digits. Nobody reads errno or the floating-point
# flags after arithmetic; without them loops with sqrt and comparisons become vector code.
FLOAT    = -ffp-contract=off -fno-math-errno -fno-trapping-math
COMMON   = -D_GNU_SOURCE $(FLOAT) -fopenmp -MMD -MP -I. $(OPT) $(SAN)
CFLAGS_  = -std=c17 $(WARN) $(COMMON) $(CFLAGS)
CXXFLAGS_ = -std=c++17 $(WARN) $(COMMON) $(CXXFLAGS)

# What each room may link; the include rules are in tests/rooms.txt.
PKG      = glib-2.0 gio-2.0 gio-unix-2.0 json-glib-1.0 cairo libmodbus openssl zlib libgpiod
PKG_CFLAGS := $(shell pkg-config --cflags $(PKG) 2>/dev/null | sed 's/-I/-isystem /g')
PKG_LIBS   := $(shell pkg-config --libs $(PKG) 2>/dev/null)
OCC_CFLAGS  = -isystem /usr/include/opencascade
OCC_LIBS    = -lTKIGES -lTKSTEP -lTKSTEPBase -lTKSTEPAttr -lTKSTEP209 -lTKXSBase -lTKShHealing \
              -lTKMesh -lTKOffset -lTKFillet -lTKBool -lTKBO -lTKPrim -lTKTopAlgo -lTKGeomAlgo \
              -lTKBRep -lTKGeomBase -lTKG3d -lTKG2d -lTKMath -lTKernel

# A make inside this one: packages are there, and both cores work unless -j says otherwise.
SUBMAKE = $(MAKE) $(if $(Q),-s) --no-print-directory NODEPS=1 \
          $(if $(findstring -j,$(MAKEFLAGS))$(findstring jobserver,$(MAKEFLAGS)),,-j$(shell nproc))

ROOMS = config segcore nc fieldbus sim agent
src   = $(sort $(wildcard $(1)/*.c $(1)/*/*.c))
obj   = $(patsubst %.c,$(BUILD)/%.o,$(call src,$(1)))

CONFIG   = $(BUILD)/libconfig.a
SEGCORE  = $(BUILD)/libsegcore.a
NC       = $(BUILD)/libnc.a
FIELDBUS = $(BUILD)/libfieldbus.a
SIM      = $(BUILD)/libsim.a
AGENT    = $(BUILD)/libagent.a
LIBS     = $(AGENT) $(SIM) $(NC) $(FIELDBUS) $(SEGCORE) $(CONFIG)

PROGRAMS = $(BUILD)/segmill $(BUILD)/vcnc $(BUILD)/segmill-cad

include tests/tests.mk

.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
.SUFFIXES:
.SECONDARY:

# The other targets call `deps` only when a package is missing, and never with NODEPS=1.
DEPS_MISSING := $(if $(NODEPS),,$(shell tests/deps.sh --missing))
.PHONY: ready
ready: $(if $(DEPS_MISSING),deps)

.PHONY: all
all: ready  ## build the programs
	$(Q)$(SUBMAKE) $(PROGRAMS)

.PHONY: deps
deps:  ## install the Debian packages that building and testing need
	$(Q)tests/deps.sh --install

.PHONY: help
help:  ## this list
	$(Q)sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1\t\2/p' Makefile tests/tests.mk | sort | expand -t 16

.PHONY: clean
clean:  ## remove build/
	$(Q)rm -rf $(BUILD)

.PHONY: install
install: all  ## install into DESTDIR and PREFIX
	$(Q)install -d $(DESTDIR)$(PREFIX)/bin $(DESTDIR)$(PREFIX)/libexec/segmill \
	    $(DESTDIR)$(PREFIX)/share/segmill $(DESTDIR)$(PREFIX)/share/doc/segmill
	$(Q)install -m 755 $(BUILD)/segmill $(BUILD)/vcnc $(DESTDIR)$(PREFIX)/bin
	$(Q)install -m 755 $(BUILD)/segmill-cad $(DESTDIR)$(PREFIX)/libexec/segmill
	$(Q)cp -r config/etc/. $(DESTDIR)$(PREFIX)/share/segmill
	$(Q)cp -r README.md ARCHITECTURE.md LICENSE docs/. $(DESTDIR)$(PREFIX)/share/doc/segmill

# ---------------------------------------------------------------- programs and rooms

$(BUILD)/segmill: $(BUILD)/agent/segmill.o $(filter-out $(SIM),$(LIBS))
	$(call say,LD,$@)
	$(Q)$(CC) $(SAN) -fopenmp $(LDFLAGS) -o $@ $^ $(PKG_LIBS) -lm

$(BUILD)/vcnc: $(BUILD)/sim/vcnc.o $(filter-out $(AGENT),$(LIBS))
	$(call say,LD,$@)
	$(Q)$(CC) $(SAN) -fopenmp $(LDFLAGS) -o $@ $^ $(PKG_LIBS) -lm

OCC_OBJ = $(patsubst %.cc,$(BUILD)/%.o,$(sort $(wildcard segcore/occ/*.cc)))
$(BUILD)/segmill-cad: $(OCC_OBJ)
	$(call say,LD,$@)
	$(Q)$(CXX) $(LDFLAGS) -o $@ $^ $(OCC_LIBS) -lglib-2.0

$(CONFIG): $(call obj,config)
$(SEGCORE): $(call obj,segcore)
$(NC): $(call obj,nc)
$(FIELDBUS): $(call obj,fieldbus)
$(SIM): $(filter-out $(BUILD)/sim/vcnc.o,$(call obj,sim))
$(AGENT): $(filter-out $(BUILD)/agent/segmill.o,$(call obj,agent))
$(LIBS):
	$(call say,AR,$@)
	$(Q)rm -f $@ && ar rcs $@ $^

$(BUILD)/%.o: %.c
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D) && $(CC) $(CFLAGS_) $(PKG_CFLAGS) -c -o $@ $<

# Open CASCADE is not ours to sanitize; SAN comes from the command line, so `override`.
$(BUILD)/segcore/occ/%.o $(BUILD)/tests/parts/%.o $(BUILD)/tests/judges/%.o: override SAN =
$(BUILD)/%.o: %.cc
	$(call say,CXX,$<)
	$(Q)mkdir -p $(@D) && $(CXX) $(CXXFLAGS_) $(OCC_CFLAGS) $(PKG_CFLAGS) -c -o $@ $<

-include $(shell find $(BUILD) -name '*.d' -type f 2>/dev/null)
