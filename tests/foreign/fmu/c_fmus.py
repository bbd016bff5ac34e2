"""Small FMUs of our own, in C, for the tests: built where there is a compiler."""

import re
import shutil
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import pytest

pytest.importorskip("fmpy", reason="needs FMPy: pip install 'dsa-des[fmi]'")
COMPILER = shutil.which("cc") or shutil.which("gcc")

#: With fault 7 it takes a step only if its state is not set again to one before (as FMUs of FhSim).
#: A low pass x' = (gain · Σu − x) / 1 s in exact steps; it counts its steps, returns early where
#: `events` is above 0 (at every multiple of it), and fails as `fault` says once t >= 0.5 s.
_MODEL = r"""
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <stdio.h>
typedef struct { double t, x, u[8], gain, events; int n, fault, steps, seen;
                 void *env; void (*log)(void*, int, const char*, const char*);
                 bool earlyAllowed; } Model;
static double sum(Model *m) { double s = 0; for (int i = 0; i < m->n; i++) s += m->u[i]; return s; }
static int misbehave(Model *m) {
  if (m->t < 0.5) return 0;
  if (m->fault == 1) { if (m->log) m->log(m->env, 3, "logStatusError", "valve stuck"); return 3; }
  if (m->fault == 2) for (volatile int i = 0;; i++) {}
  if (m->fault == 3) { fprintf(stderr, "last words\n"); fflush(stderr); abort(); }
  if (m->fault == 4) exit(0);
  return 0;
}
static void advance(Model *m, double t) {
  m->x = m->gain * sum(m) + (m->x - m->gain * sum(m)) * exp(m->t - t);
  m->t = t;
}
static Model *fresh(void) {
  Model *m = calloc(1, sizeof(Model)); m->gain = 1; m->n = 3; return m;
}
"""

_FMI3 = r"""
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool v,
    bool l, bool ev, bool early, const uint32_t *r, size_t nr, void *env,
    void (*log)(void*, int, const char*, const char*), void *up) {
  if (strcmp(token, "lag")) return 0;
  Model *m = fresh(); m->env = env; m->log = log; m->earlyAllowed = early; return m;
}
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool td, double tol, double t, bool sd, double stop) {
  ((Model *)c)->t = t; return 0; }
int fmi3ExitInitializationMode(void *c) { return 0; }
int fmi3EnterConfigurationMode(void *c) { return 0; }
int fmi3ExitConfigurationMode(void *c) { return 0; }
int fmi3EnterEventMode(void *c) { return 0; }
int fmi3EnterStepMode(void *c) { return 0; }
int fmi3UpdateDiscreteStates(void *c, bool *a, bool *b, bool *d, bool *e, bool *f, double *g) {
  Model *m = c; *a = *d = *e = *f = false; *b = m->fault == 5 && m->t > 0.52; m->seen++;
  return 0; }
int fmi3Terminate(void *c) { return 0; }
int fmi3Reset(void *c) { Model *m = c; Model *n = fresh(); n->env = m->env; n->log = m->log;
  n->earlyAllowed = m->earlyAllowed; *m = *n; free(n); return 0; }
int fmi3GetFMUState(void *c, void **s) { *s = malloc(sizeof(Model)); memcpy(*s, c, sizeof(Model));
  return 0; }
int fmi3SetFMUState(void *c, void *s) { memcpy(c, s, sizeof(Model)); return 0; }
int fmi3FreeFMUState(void *c, void **s) { free(*s); *s = 0; return 0; }
int fmi3GetFloat64(void *c, const uint32_t *vr, size_t n, double *v, size_t nv) {
  Model *m = c;
  for (size_t i = 0; i < n; i++) switch (vr[i]) {
    case 1: for (int j = 0; j < m->n; j++) *v++ = m->u[j]; break;
    case 2: *v++ = m->x; break;
    case 3: for (int j = 0; j < m->n; j++) *v++ = m->x * m->u[j]; break;
    case 4: *v++ = m->t; break;
    case 12: *v++ = m->u[0] > 0 && m->u[0] < 20000 ? 0.5 : 0; break;
    case 13: *v++ = 0.05; break;
    default: return 3; }
  return 0;
}
int fmi3SetFloat64(void *c, const uint32_t *vr, size_t n, const double *v, size_t nv) {
  Model *m = c;
  for (size_t i = 0; i < n; i++) switch (vr[i]) {
    case 1: for (int j = 0; j < m->n; j++) m->u[j] = *v++; break;
    case 2: m->x = *v++; break;
    case 5: m->gain = *v++; break;
    case 6: m->events = *v++; break;
    default: return 3; }
  return 0;
}
int fmi3SetInt32(void *c, const uint32_t *vr, size_t n, const int32_t *v, size_t nv) {
  ((Model *)c)->fault = v[0]; return 0; }
int fmi3GetInt32(void *c, const uint32_t *vr, size_t n, int32_t *v, size_t nv) {
  Model *m = c;
  for (size_t i = 0; i < n; i++) v[i] = vr[i] == 8 ? m->steps : m->seen;
  return 0; }
int fmi3SetUInt64(void *c, const uint32_t *vr, size_t n, const uint64_t *v, size_t nv) {
  ((Model *)c)->n = (int)v[0]; return 0; }
int fmi3GetUInt64(void *c, const uint32_t *vr, size_t n, uint64_t *v, size_t nv) {
  v[0] = 18446744073709551615ull; return 0; }
int fmi3DoStep(void *c, double t, double h, bool np, bool *ev, bool *end, bool *early, double *last)
{ Model *m = c;
  int status = misbehave(m); if (status) return status;
  if (m->fault == 7 && !np) { *ev = *end = *early = false; return 0; }
  double to = t + h; *ev = *end = *early = false;
  if (m->events > 0 && m->earlyAllowed) {
    double next = m->events * (floor(m->t / m->events + 1e-9) + 1);
    if (next < to - 1e-12) { to = next; *early = true; *ev = true; }
  }
  advance(m, to); m->steps++; *last = to; return 0;
}
"""

_FMI2 = r"""
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *path,
    void *calls, int v, int l) { return strcmp(guid, "lag") ? 0 : fresh(); }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double tol, double t, int s, double stop) {
  ((Model *)c)->t = t; return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Reset(void *c) { Model *n = fresh(); *(Model *)c = *n; free(n); return 0; }
int fmi2GetFMUstate(void *c, void **s) { *s = malloc(sizeof(Model)); memcpy(*s, c, sizeof(Model));
  return 0; }
int fmi2SetFMUstate(void *c, void *s) { memcpy(c, s, sizeof(Model)); return 0; }
int fmi2FreeFMUstate(void *c, void **s) { free(*s); *s = 0; return 0; }
int fmi2GetReal(void *c, const uint32_t *vr, size_t n, double *v) {
  Model *m = c;
  for (size_t i = 0; i < n; i++) v[i] = vr[i] == 2 ? m->x : vr[i] == 4 ? m->t : m->u[0];
  return 0; }
int fmi2SetReal(void *c, const uint32_t *vr, size_t n, const double *v) {
  Model *m = c;
  for (size_t i = 0; i < n; i++) switch (vr[i]) { case 1: m->u[0] = v[i]; break;
    case 2: m->x = v[i]; break; case 5: m->gain = v[i]; break; default: return 3; }
  return 0; }
int fmi2SetInteger(void *c, const uint32_t *vr, size_t n, const int *v) {
  ((Model *)c)->fault = v[0]; return 0; }
int fmi2GetBooleanStatus(void *c, int kind, int *v) {
  *v = kind == 3 && ((Model *)c)->fault == 5; return 0; }
int fmi2GetRealStatus(void *c, int kind, double *v) { *v = ((Model *)c)->t; return 0; }
int fmi2DoStep(void *c, double t, double h, int np) {
  Model *m = c; int status = misbehave(m); if (status) return status;
  if (m->fault == 7 && !np) return 0;
  if ((m->fault == 5 || m->fault == 6) && t + h > 1.03) { advance(m, 1.03); return 2; }
  advance(m, t + h); return 0; }
"""

_UNITS = """<UnitDefinitions>
  <Unit name="m"><BaseUnit m="1"/></Unit>
  <Unit name="ft"><BaseUnit m="1" factor="0.3048"/></Unit>
 </UnitDefinitions>"""

_DESCRIPTION3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="lag" instantiationToken="lag">
 <CoSimulation modelIdentifier="lag" canGetAndSetFMUState="{rewindable}"
   canHandleVariableCommunicationStepSize="true" hasEventMode="true"
   mightReturnEarlyFromDoStep="true"/>
 {units}
 <DefaultExperiment startTime="0" stopTime="1" stepSize="0.25"/>
 <ModelVariables>
  <UInt64 name="n" valueReference="9" causality="structuralParameter" variability="tunable"
    start="3"/>
  <Float64 name="u" valueReference="1" causality="input" start="0" unit="ft">
    <Dimension valueReference="9"/></Float64>
  <Float64 name="x" valueReference="2" causality="output" initial="exact" start="0" unit="ft"/>
  <Float64 name="xu" valueReference="3" causality="output"><Dimension valueReference="9"/></Float64>
  <Float64 name="time_reached" valueReference="4" causality="output"/>
  <Float64 name="gain" valueReference="5" causality="parameter" variability="fixed" start="1"/>
  <Float64 name="events" valueReference="6" causality="parameter" variability="fixed" start="0"/>
  <Int32 name="fault" valueReference="7" causality="parameter" variability="fixed" start="0"/>
  <Int32 name="steps" valueReference="8" causality="output"/>
  <Int32 name="seen" valueReference="10" causality="output"/>
  <Float64 name="turn" valueReference="12" causality="local" unit="rad"/>
  <Float64 name="turn_rate" valueReference="13" causality="local" unit="rad/s"/>
  <UInt64 name="largest" valueReference="11" causality="local"/>
 </ModelVariables>
 <ModelStructure><Output valueReference="2"/></ModelStructure>
</fmiModelDescription>"""

_DESCRIPTION2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="lag">
 <CoSimulation modelIdentifier="lag" canGetAndSetFMUstate="{rewindable}"
   canHandleVariableCommunicationStepSize="true"/>
 {units}
 <ModelVariables>
  <ScalarVariable name="u" valueReference="1" causality="input"><Real start="0" unit="ft"/>
  </ScalarVariable>
  <ScalarVariable name="x" valueReference="2" causality="output" initial="exact">
    <Real start="0" unit="ft"/></ScalarVariable>
  <ScalarVariable name="gain" valueReference="5" causality="parameter" variability="fixed">
    <Real start="1"/></ScalarVariable>
  <ScalarVariable name="fault" valueReference="7" causality="parameter" variability="fixed">
    <Integer start="0"/></ScalarVariable>
 </ModelVariables>
 <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>"""


def lag_fmu(
    folder: Path, version: int = 3, *, rewindable: bool = True, platform: str = "",
    change: tuple[str, str] = ("", ""), more: str = "",
) -> Path:  # fmt: skip
    """Build a low pass as an FMU; a test that needs it is left out where there is no compiler.

    What it says of itself is changed, and `more` is added to its source.
    """
    said = (_DESCRIPTION3 if version == 3 else _DESCRIPTION2).format(
        rewindable=str(rewindable).lower(), units=_UNITS
    )
    assert change[0] in said
    said = said.replace(*change)
    source = _MODEL + (_FMI3 if version == 3 else _FMI2) + more
    return packed(folder / "lag.fmu", said, source, version, platform)


def packed(
    path: Path, said: str, source: str, version: int, platform: str = "", **resources: str
) -> Path:
    """Compile a source and write it as an FMU, with files among its resources."""
    if COMPILER is None or sys.platform != "linux":
        pytest.skip("needs a C compiler")
    import fmpy

    name = platform or (fmpy.platform_tuple if version == 3 else fmpy.platform)
    identifier = re.findall(r'modelIdentifier="(\w+)"', said)[0]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", said)
        archive.writestr(f"binaries/{name}/{identifier}.so", _library(source, version))
        for file, text in resources.items():
            archive.writestr(f"resources/{file}.txt", text)
    return path


@cache
def _library(source: str, version: int) -> bytes:
    """Return the compiled library, in which what the model has no function for returns an error."""
    import tempfile

    from fmpy import fmi2, fmi3

    slaves = [fmi3.FMU3Slave, fmi3.FMU3ScheduledExecution] if version == 3 else [fmi2.FMU2Slave]
    written = set(re.findall(r"\bfmi[23]\w+", source))
    known = {name for slave in slaves for name in dir(slave) if re.match(r"fmi[23][A-Z]", name)}
    source += "".join(f"int {name}(void) {{ return 3; }}\n" for name in sorted(known - written))
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder, "model.c"), Path(folder, "model.so")
        file.write_text(source)
        assert COMPILER is not None
        command = [COMPILER, "-shared", "-fPIC", "-O1", "-o", str(library), str(file), "-lm"]
        subprocess.run(command, check=True, capture_output=True)
        return library.read_bytes()
