"""A sensor as an FMU, in C: it sees what it is given within its reach, and says how surely."""

from pathlib import Path

from c_fmus import packed

#: For each of n aircraft azimuth, elevation (rad) and range (m) in, and in degrees and km out.
_MODEL = r"""
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#define MOST 4
#define DEG (180.0 / 3.14159265358979323846)
typedef struct { double t, in[3][MOST], before[MOST], rate[MOST], reach; int n; char label[32];
} Eye;
static Eye *fresh(void) { Eye *m = calloc(1, sizeof(Eye)); m->n = 2; m->reach = 1e9; return m; }
static void step(Eye *m, double h) {
  for (int i = 0; i < m->n; i++) {
    m->rate[i] = (m->in[2][i] - m->before[i]) / h; m->before[i] = m->in[2][i]; }
  m->t += h; }
static bool seen(Eye *m, int i) { return m->in[2][i] > 0 && m->in[2][i] < m->reach; }
static double said(Eye *m, int what, int i) {
  switch (what) { case 0: case 1: return m->in[what][i] * DEG; case 2: return m->in[2][i] / 1000;
    case 3: return m->rate[i]; case 4: return 0.1; default: return 25.0; } }
"""

_FMI3 = r"""
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool v,
    bool l, bool ev, bool early, const uint32_t *r, size_t nr, void *env,
    void (*log)(void*, int, const char*, const char*), void *up) { return fresh(); }
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool td, double tol, double t, bool sd, double stop) {
  return 0; }
int fmi3ExitInitializationMode(void *c) { return 0; }
int fmi3EnterConfigurationMode(void *c) { return 0; }
int fmi3ExitConfigurationMode(void *c) { return 0; }
int fmi3Terminate(void *c) { return 0; }
int fmi3Reset(void *c) { Eye *n = fresh(); *(Eye *)c = *n; free(n); return 0; }
int fmi3GetFMUState(void *c, void **s) { *s = malloc(sizeof(Eye)); memcpy(*s, c, sizeof(Eye));
  return 0; }
int fmi3SetFMUState(void *c, void *s) { memcpy(c, s, sizeof(Eye)); return 0; }
int fmi3FreeFMUState(void *c, void **s) { free(*s); *s = 0; return 0; }
int fmi3GetFloat64(void *c, const uint32_t *vr, size_t n, double *v, size_t nv) {
  Eye *m = c;
  for (size_t k = 0; k < n; k++) {
    int what = (int)vr[k] - 10;
    if (what < 0) return 3;
    if (what >= 4) { *v++ = said(m, what, 0); continue; }
    for (int i = 0; i < m->n; i++) *v++ = said(m, what, i); }
  return 0; }
int fmi3SetFloat64(void *c, const uint32_t *vr, size_t n, const double *v, size_t nv) {
  Eye *m = c;
  for (size_t k = 0; k < n; k++) {
    if (vr[k] == 5) { m->reach = *v++; continue; }
    for (int i = 0; i < m->n; i++) m->in[vr[k] - 2][i] = *v++; }
  return 0; }
int fmi3GetBoolean(void *c, const uint32_t *vr, size_t n, bool *v, size_t nv) {
  Eye *m = c; for (int i = 0; i < m->n; i++) v[i] = seen(m, i); return 0; }
int fmi3SetUInt64(void *c, const uint32_t *vr, size_t n, const uint64_t *v, size_t nv) {
  ((Eye *)c)->n = (int)v[0]; return 0; }
int fmi3DoStep(void *c, double t, double h, bool np, bool *ev, bool *end, bool *early, double *last)
{ step(c, h); *ev = *end = *early = false; *last = t + h; return 0; }
"""

#: As scalar variables, with references 10 + 10 i + what; and text to and fro.
_FMI2 = r"""
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *path,
    void *calls, int v, int l) { return fresh(); }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double tol, double t, int s, double stop) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Reset(void *c) { Eye *n = fresh(); *(Eye *)c = *n; free(n); return 0; }
int fmi2GetReal(void *c, const uint32_t *vr, size_t n, double *v) {
  for (size_t k = 0; k < n; k++) v[k] = said(c, vr[k] % 10, vr[k] / 10 - 2);
  return 0; }
int fmi2SetReal(void *c, const uint32_t *vr, size_t n, const double *v) {
  Eye *m = c;
  for (size_t k = 0; k < n; k++) {
    if (vr[k] == 5) m->reach = v[k]; else m->in[vr[k] % 10 - 6][vr[k] / 10 - 2] = v[k]; }
  return 0; }
int fmi2GetBoolean(void *c, const uint32_t *vr, size_t n, int *v) {
  for (size_t k = 0; k < n; k++) v[k] = seen(c, vr[k] / 10 - 2);
  return 0; }
int fmi2SetString(void *c, const uint32_t *vr, size_t n, const char **v) {
  strncpy(((Eye *)c)->label, v[0], 31); return 0; }
int fmi2GetString(void *c, const uint32_t *vr, size_t n, const char **v) {
  v[0] = ((Eye *)c)->label; return 0; }
int fmi2SetInteger(void *c, const uint32_t *vr, size_t n, const int *v) {
  if (v[0] == 7) ((Eye *)c)->reach = 0; return 0; }
int fmi2DoStep(void *c, double t, double h, int np) { step(c, h); return 0; }
"""

_UNITS = """<UnitDefinitions>
  <Unit name="rad"><BaseUnit rad="1"/></Unit>
  <Unit name="deg"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit>
  <Unit name="m"><BaseUnit m="1"/></Unit>
  <Unit name="m2"><BaseUnit m="2"/></Unit>
  <Unit name="km"><BaseUnit m="1" factor="1000"/></Unit>
  <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
 </UnitDefinitions>"""
_INPUTS = (("azimuth_in", "rad"), ("elevation_in", "rad"), ("range_in", "m"))
_OUTPUTS = (("azimuth", "deg"), ("elevation", "deg"), ("range", "km"), ("rate", "m/s"))


def eye_fmu(folder: Path, version: int = 3) -> Path:
    """Build the sensor: in FMI 3 with arrays, in FMI 2 with ``plane[1].range`` and the like."""
    lines = _of_three() if version == 3 else _of_two()
    token = "instantiationToken" if version == 3 else "guid"
    can = "canGetAndSetFMUState" if version == 3 else "canGetAndSetFMUstate"
    said = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="{version}.0" '
        f'modelName="eye" {token}="eye"><CoSimulation modelIdentifier="eye" '
        f'{can}="{str(version == 3).lower()}" canHandleVariableCommunicationStepSize="true"/>'
        f"{_UNITS}{_MODES if version == 2 else ''}<ModelVariables>{''.join(lines)}"
        "</ModelVariables><ModelStructure/></fmiModelDescription>"
    )
    return packed(folder / "eye.fmu", said, _MODEL + (_FMI3 if version == 3 else _FMI2), version)


_MODES = """<TypeDefinitions><SimpleType name="Mode"><Enumeration>
 <Item name="looking" value="1"/><Item name="shut" value="7"/></Enumeration></SimpleType>
 </TypeDefinitions>"""


def _of_three() -> list[str]:
    dimension = '<Dimension valueReference="1"/></Float64>'
    lines = [
        '<UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed" '
        'start="2"/>',
        '<Float64 name="reach" valueReference="5" causality="parameter" variability="fixed" '
        'start="1e9" unit="m"/>',
        '<Boolean name="seen" valueReference="6" causality="output"><Dimension valueReference="1"/>'
        "</Boolean>",
        '<Float64 name="sigma" valueReference="14" causality="output" unit="deg"/>',
        '<Float64 name="spread" valueReference="15" causality="output" unit="m2"/>',
    ]
    for k, (name, unit) in enumerate(_INPUTS):
        lines.append(
            f'<Float64 name="{name}" valueReference="{2 + k}" causality="input" start="0" '
            f'unit="{unit}">{dimension}'
        )
    for k, (name, unit) in enumerate(_OUTPUTS):
        lines.append(
            f'<Float64 name="{name}" valueReference="{10 + k}" causality="output" unit="{unit}">'
            f"{dimension}"
        )
    return lines


def _of_two() -> list[str]:
    def variable(name: str, reference: int, causality: str, inner: str) -> str:
        return (
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{"fixed" if causality == "parameter" else "discrete"}">{inner}'
            "</ScalarVariable>"
        )

    lines = [
        variable("reach", 5, "parameter", '<Real start="1e9" unit="m"/>'),
        variable("label", 1, "parameter", '<String start=""/>'),
        variable("echo", 2, "output", "<String/>"),
        variable("mode", 3, "parameter", '<Enumeration declaredType="Mode" start="1"/>'),
    ]
    for i in (1, 2):
        base = 10 + 10 * i
        lines.append(variable(f"plane[{i}].seen", base + 9, "output", "<Boolean/>"))
        for k, (name, unit) in enumerate(_INPUTS):
            inner = f'<Real start="0" unit="{unit}"/>'
            lines.append(variable(f"plane[{i}].{name}", base + 6 + k, "input", inner))
        for k, (name, unit) in enumerate(_OUTPUTS):
            lines.append(
                variable(f"plane[{i}].{name}", base + k, "output", f'<Real unit="{unit}"/>')
            )
    return lines
