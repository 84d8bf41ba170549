#include <pybind11/pybind11.h>

#include "bindings.hpp"
#include "raise.hpp"

namespace py = pybind11;

namespace abbe::python {
namespace {

const char* name_of(daemon::ErrorCode code) {
  switch (code) {
    case daemon::ErrorCode::Usage:
      return "usage";
    case daemon::ErrorCode::BadInput:
      return "bad_input";
    case daemon::ErrorCode::Refused:
      return "refused";
    case daemon::ErrorCode::DataInsufficient:
      return "data_insufficient";
    case daemon::ErrorCode::Io:
      return "io";
    case daemon::ErrorCode::StopNotConfirmed:
      return "stop_not_confirmed";
    case daemon::ErrorCode::StopNotSent:
      return "stop_not_sent";
  }
  return "unknown";
}

void translate(std::exception_ptr thrown) {
  try {
    std::rethrow_exception(std::move(thrown));
  } catch (const Raised& raised) {
    const py::object type = py::module_::import("abbe.errors").attr("Error");
    py::list details;
    for (const std::string& detail : raised.error.details) details.append(detail);
    const py::object error = type(name_of(raised.error.code), raised.error.text, details);
    PyErr_SetObject(type.ptr(), error.ptr());
  }
}

}  // namespace
}  // namespace abbe::python

PYBIND11_MODULE(_abbe, module) {
  module.doc() = "Models and recordings of abbe; use the package abbe.";
  py::register_exception_translator(abbe::python::translate);
  abbe::python::bind_model(module);
  abbe::python::bind_recording(module);
  abbe::python::bind_tasks(module);
  abbe::python::bind_identify(module);
}
