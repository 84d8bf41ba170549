// Requests for a calibration from the files of a user, as JSON texts. The files are read and
// checked as the command line does it.
#include <pybind11/stl.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/json_text.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/evemu/task_of_files.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "bindings.hpp"
#include "raise.hpp"

namespace py = pybind11;

namespace abbe::python {
namespace {

using daemon::CalibrationTask;

std::string otf_task(const std::string& path) {
  auto read = value_or_raise(daemon::read_path_csv(path));
  return daemon::json_text(
      to_json(CalibrationTask{daemon::OtfRequest{std::move(read.vertices_m), {}}}));
}

std::string evemu_task(const std::string& calibrator,
                       const std::optional<std::string>& rotation_reference,
                       std::optional<double> u_reference_m) {
  if (rotation_reference && !u_reference_m)
    throw py::value_error("rotation_reference needs u_reference_m, the standard uncertainty of V");
  const auto array = value_or_raise(daemon::read_calibrator_toml(calibrator));
  std::optional<daemon::BallErrorsFile> reference;
  if (rotation_reference) reference = value_or_raise(daemon::read_errors_csv(*rotation_reference));
  return daemon::json_text(
      daemon::evemu_task(array, reference ? &*reference : nullptr, u_reference_m.value_or(0.0)));
}

daemon::MfbRequest::File with_text(const std::string& file) {
  return {std::filesystem::path(file).filename().string(), value_or_raise(daemon::read_text(file))};
}

/// The request for method mfb. Bar and plan are also checked here, so that messages contain the
/// file names as the user gave them.
std::string mfb_task(const std::string& bar, const std::string& plan) {
  daemon::MfbRequest request{with_text(bar), with_text(plan), {}};
  const auto read = value_or_raise(daemon::parse_bar_toml(request.bar.text, bar));
  (void)value_or_raise(daemon::parse_bar_plan_toml(request.plan.text, plan, read.bar));
  return daemon::json_text(to_json(CalibrationTask{std::move(request)}));
}

}  // namespace

void bind_tasks(py::module_& module) {
  module.def("otf_task", &otf_task, py::arg("path"));
  module.def("evemu_task", &evemu_task, py::arg("calibrator"),
             py::arg("rotation_reference") = py::none(), py::arg("u_reference_m") = py::none());
  module.def("mfb_task", &mfb_task, py::arg("bar"), py::arg("plan"));
}

}  // namespace abbe::python
