// What the module of an instruction set takes in.
#pragma once
#include <nanobind/nanobind.h>

void bind_batch(nanobind::module_ &m);
void bind_diagnosis(nanobind::module_ &m);
void bind_filter(nanobind::module_ &m);
void bind_readers(nanobind::module_ &m);
