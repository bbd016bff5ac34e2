"""An FMU of FMI 3 with what the others have not: matrices, types, resources, clocks, time events.

It has what the Reference FMUs StateSpace, Resource, Stair and Clocks have; the code is ours.
"""

from pathlib import Path

from c_fmus import packed

_MODEL = r"""
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
typedef struct { double t, a[9], u[3], next, every, lastEvent, lastTick; float half; int rows, cols;
  int8_t small; int64_t mode; char text[32], resource[64]; uint8_t bytes[8]; size_t size;
  int regular, manual, counted, events; bool due[3], third, wants; char where[512]; } All;
static All *fresh(const char *path) {
  All *m = calloc(1, sizeof(All)); m->rows = 2; m->cols = 2; m->mode = 1; m->wants = true;
  strncpy(m->where, path, 500);
  char file[600]; snprintf(file, 600, "%s%s", path, "level.txt");
  FILE *f = fopen(file, "r");
  if (!f || !fgets(m->resource, 63, f)) strcpy(m->resource, "none");
  if (f) fclose(f);
  return m; }
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool v,
    bool l, bool ev, bool early, const uint32_t *r, size_t nr, void *env,
    void (*log)(void*, int, const char*, const char*), void *up) { return fresh(path); }
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool td, double tol, double t, bool sd, double stop) {
  All *m = c; m->t = t; m->next = m->every > 0 ? t + m->every : 0; return 0; }
int fmi3ExitInitializationMode(void *c) { return 0; }
int fmi3EnterConfigurationMode(void *c) { return 0; }
int fmi3ExitConfigurationMode(void *c) { return 0; }
int fmi3EnterEventMode(void *c) { return 0; }
int fmi3EnterStepMode(void *c) { return 0; }
int fmi3Terminate(void *c) { return 0; }
int fmi3Reset(void *c) { All *n = fresh(((All *)c)->where); *(All *)c = *n; free(n); return 0; }
int fmi3GetFMUState(void *c, void **s) { *s = malloc(sizeof(All)); memcpy(*s, c, sizeof(All));
  return 0; }
int fmi3SetFMUState(void *c, void *s) { memcpy(c, s, sizeof(All)); return 0; }
int fmi3FreeFMUState(void *c, void **s) { free(*s); *s = 0; return 0; }
int fmi3UpdateDiscreteStates(void *c, bool *a, bool *b, bool *d, bool *e, bool *f, double *g) {
  All *m = c; *a = *b = *d = *e = false;
  if (m->due[0]) { m->regular++; m->lastTick = m->t; m->third = m->regular % 3 == 0; }
  if (m->due[1]) { m->manual++; m->lastTick = m->t; }
  if (m->due[2]) { m->counted++; m->wants = true; }
  bool any = m->due[0] || m->due[1] || m->due[2];
  m->due[0] = m->due[1] = m->due[2] = false;
  if (m->next > 0 && m->t >= m->next - 1e-12) {
    m->events++; m->lastEvent = m->t; m->next += m->every; }
  *a = any && m->third; *f = m->next > 0; *g = m->next;
  return 0; }
int fmi3SetClock(void *c, const uint32_t *vr, size_t n, const bool *v) {
  for (size_t i = 0; i < n; i++) ((All *)c)->due[vr[i] - 50] = v[i];
  return 0; }
int fmi3GetClock(void *c, const uint32_t *vr, size_t n, bool *v) {
  All *m = c; v[0] = m->third; m->third = false; return 0; }
int fmi3GetIntervalFraction(void *c, const uint32_t *vr, size_t n, uint64_t *counter,
    uint64_t *resolution, int *qualifier) {
  All *m = c; counter[0] = 1; resolution[0] = 7; qualifier[0] = m->wants ? 2 : 1; m->wants = false;
  return 0; }
int fmi3DoStep(void *c, double t, double h, bool np, bool *ev, bool *end, bool *early, double *last)
{ ((All *)c)->t = *last = t + h; *ev = *end = *early = false; return 0; }
int fmi3GetFloat64(void *c, const uint32_t *vr, size_t n, double *v, size_t nv) {
  All *m = c;
  for (size_t k = 0; k < n; k++) switch (vr[k]) {
    case 5: for (int i = 0; i < m->rows; i++) { double s = 0;
        for (int j = 0; j < m->cols; j++) s += m->a[i * m->cols + j] * m->u[j];
        *v++ = s; } break;
    case 6: *v++ = m->lastTick; break;
    case 7: *v++ = m->lastEvent; break;
    default: return 3; }
  return 0; }
int fmi3SetFloat64(void *c, const uint32_t *vr, size_t n, const double *v, size_t nv) {
  All *m = c;
  for (size_t k = 0; k < n; k++) switch (vr[k]) {
    case 3: memcpy(m->a, v, sizeof(double) * m->rows * m->cols); v += m->rows * m->cols; break;
    case 4: memcpy(m->u, v, sizeof(double) * m->cols); v += m->cols; break;
    case 8: m->every = *v++; break;
    default: return 3; }
  return 0; }
int fmi3SetFloat32(void *c, const uint32_t *vr, size_t n, const float *v, size_t nv) {
  ((All *)c)->half = v[0]; return 0; }
int fmi3GetFloat32(void *c, const uint32_t *vr, size_t n, float *v, size_t nv) {
  v[0] = ((All *)c)->half / 2; return 0; }
int fmi3SetInt8(void *c, const uint32_t *vr, size_t n, const int8_t *v, size_t nv) {
  ((All *)c)->small = v[0]; return 0; }
int fmi3GetInt8(void *c, const uint32_t *vr, size_t n, int8_t *v, size_t nv) {
  v[0] = -((All *)c)->small; return 0; }
int fmi3SetInt64(void *c, const uint32_t *vr, size_t n, const int64_t *v, size_t nv) {
  ((All *)c)->mode = v[0]; return 0; }
int fmi3GetInt64(void *c, const uint32_t *vr, size_t n, int64_t *v, size_t nv) {
  v[0] = ((All *)c)->mode; return 0; }
int fmi3GetInt32(void *c, const uint32_t *vr, size_t n, int32_t *v, size_t nv) {
  All *m = c;
  for (size_t k = 0; k < n; k++) switch (vr[k]) { case 30: v[k] = m->regular; break;
    case 31: v[k] = m->manual; break; case 32: v[k] = m->counted; break;
    default: v[k] = m->events; }
  return 0; }
int fmi3SetUInt64(void *c, const uint32_t *vr, size_t n, const uint64_t *v, size_t nv) {
  All *m = c;
  for (size_t k = 0; k < n; k++) { if (vr[k] == 1) m->rows = (int)v[k]; else m->cols = (int)v[k]; }
  return 0; }
int fmi3SetString(void *c, const uint32_t *vr, size_t n, const char **v, size_t nv) {
  strncpy(((All *)c)->text, v[0], 31); return 0; }
int fmi3GetString(void *c, const uint32_t *vr, size_t n, const char **v, size_t nv) {
  All *m = c;
  for (size_t k = 0; k < n; k++) v[k] = vr[k] == 21 ? m->text : m->resource;
  return 0; }
int fmi3SetBinary(void *c, const uint32_t *vr, size_t n, const size_t *sizes, const uint8_t **v,
    size_t nv) {
  All *m = c; m->size = sizes[0]; memcpy(m->bytes, v[0], sizes[0]); return 0; }
int fmi3GetBinary(void *c, const uint32_t *vr, size_t n, size_t *sizes, const uint8_t **v,
    size_t nv) {
  All *m = c; sizes[0] = m->size; v[0] = m->bytes; return 0; }
"""

_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="all" instantiationToken="all">
 <CoSimulation modelIdentifier="all" canGetAndSetFMUState="true" hasEventMode="true"
   canHandleVariableCommunicationStepSize="true"/>
 <TypeDefinitions><EnumerationType name="Mode"><Item name="low" value="1"/>
   <Item name="high" value="5"/></EnumerationType></TypeDefinitions>
 <ModelVariables>
  <UInt64 name="rows" valueReference="1" causality="structuralParameter" variability="fixed"
    start="2"/>
  <UInt64 name="cols" valueReference="2" causality="structuralParameter" variability="fixed"
    start="2"/>
  <Float64 name="A" valueReference="3" causality="parameter" variability="tunable" start="0">
    <Dimension valueReference="1"/><Dimension valueReference="2"/></Float64>
  <Float64 name="u" valueReference="4" causality="input" start="0">
    <Dimension valueReference="2"/></Float64>
  <Float64 name="y" valueReference="5" causality="output"><Dimension valueReference="1"/></Float64>
  <Float64 name="last_tick" valueReference="6" causality="output"/>
  <Float64 name="last_event" valueReference="7" causality="output"/>
  <Float64 name="every" valueReference="8" causality="parameter" variability="fixed" start="0"/>
  <Float32 name="whole" valueReference="10" causality="parameter" variability="fixed" start="0"/>
  <Float32 name="half" valueReference="11" causality="output"/>
  <Int8 name="small" valueReference="12" causality="parameter" variability="fixed" start="0"/>
  <Int8 name="negative" valueReference="13" causality="output"/>
  <Enumeration name="mode" declaredType="Mode" valueReference="14" causality="parameter"
    variability="fixed" start="1"/>
  <Enumeration name="mode_out" declaredType="Mode" valueReference="15" causality="output"/>
  <String name="text" valueReference="20" causality="parameter" variability="fixed">
    <Start value=""/></String>
  <String name="text_out" valueReference="21" causality="output"/>
  <String name="level" valueReference="22" causality="output"/>
  <Binary name="bytes" valueReference="23" causality="parameter" variability="fixed">
    <Start value=""/></Binary>
  <Binary name="bytes_out" valueReference="24" causality="output"/>
  <Int32 name="regular" valueReference="30" causality="output"/>
  <Int32 name="manual" valueReference="31" causality="output"/>
  <Int32 name="counted" valueReference="32" causality="output"/>
  <Int32 name="events" valueReference="33" causality="output"/>
  <Clock name="regularly" valueReference="50" causality="input" intervalVariability="constant"
    intervalCounter="{counter}" resolution="{resolution}" shiftCounter="1"
    supportsFraction="true"/>
  <Clock name="by_hand" valueReference="51" causality="input" intervalVariability="triggered"/>
  <Clock name="counts" valueReference="52" causality="input" intervalVariability="countdown"
    supportsFraction="true"/>
  <Clock name="third" valueReference="53" causality="output" intervalVariability="triggered"/>
 </ModelVariables>
 <ModelStructure><Output valueReference="5"/></ModelStructure>
</fmiModelDescription>"""


def all_kinds_fmu(folder: Path, interval: str = "3/10") -> Path:
    """Build it; its regular clock ticks at an interval, from one counter of its resolution on."""
    counter, resolution = interval.split("/")
    said = _DESCRIPTION.format(counter=counter, resolution=resolution)
    return packed(folder / "all.fmu", said, _MODEL, 3, level="fourteen")
