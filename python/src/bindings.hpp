#pragma once

#include <pybind11/pybind11.h>

namespace abbe::python {

void bind_model(pybind11::module_& module);
void bind_recording(pybind11::module_& module);
void bind_tasks(pybind11::module_& module);
void bind_identify(pybind11::module_& module);

}  // namespace abbe::python
