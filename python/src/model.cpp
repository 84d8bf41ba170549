#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/calib_error.hpp"
#include "abbe/model/model_use.hpp"
#include "bindings.hpp"
#include "raise.hpp"

namespace py = pybind11;

namespace abbe::python {
namespace {

using calib::Vector3;
using daemon::ModelDocument;
using Points = py::array_t<double, py::array::c_style | py::array::forcecast>;

[[noreturn]] void refuse(const std::string& text) {
  throw Raised({daemon::ErrorCode::Usage, text, {}});
}

/// Number of points; `points` must have the shape (N, 3).
py::ssize_t rows_of(const Points& points, const char* name) {
  if (points.ndim() != 2 || points.shape(1) != 3)
    refuse(std::string{name} + ": must be an array of N x 3 numbers, in m");
  return points.shape(0);
}

Vector3 tool_of(const ModelDocument& document, const std::optional<Vector3>& tool_m) {
  if (tool_m) return *tool_m;
  if (document.model.tool_offsets_m().size() != 1)
    refuse("tool_m: the model is valid for several tool offsets; give one, x, y, z in m");
  return document.model.tool_offsets_m().front();
}

py::array_t<double> table_of(std::span<const Vector3> rows) {
  py::array_t<double> out({static_cast<py::ssize_t>(rows.size()), py::ssize_t{3}});
  auto to = out.mutable_unchecked<2>();
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (int k = 0; k < 3; ++k) to(static_cast<py::ssize_t>(i), k) = rows[i][k];
  return out;
}

/// Direction of travel of X, Y, Z: -1, 0 (unknown) or 1 each.
using Direction = std::optional<std::array<int, 3>>;

calib::AxisTravel travel_of(const ModelDocument& document, const Direction& direction) {
  calib::AxisTravel travel{};
  if (!direction) return travel;
  if (document.model.travel() == nullptr)
    throw Raised({daemon::ErrorCode::DataInsufficient,
                  "direction: the model has no backlash, so V in one direction of travel is not "
                  "known; leave the direction out",
                  {}});
  for (std::size_t a = 0; a < travel.size(); ++a) {
    const int towards = (*direction)[a];
    if (towards < -1 || towards > 1)
      refuse(fmt::format("direction: {} for {}: must be -1, 0 (unknown) or 1", towards, "XYZ"[a]));
    travel[a] = static_cast<calib::Travel>(towards);
  }
  return travel;
}

/// Returns (V_m (N, 3), cov_m2 (N, 3, 3), inside (N)).
py::tuple error_at(const ModelDocument& document, const Points& points_m,
                   const std::optional<Vector3>& tool_m, const Direction& direction) {
  const py::ssize_t n = rows_of(points_m, "points_m");
  const Vector3 tool = tool_of(document, tool_m);
  const auto travel = travel_of(document, direction);
  py::array_t<double> V({n, py::ssize_t{3}}), cov({n, py::ssize_t{3}, py::ssize_t{3}});
  py::array_t<bool> inside(n);
  const double* const at = points_m.data();
  double* const to_V = V.mutable_data();
  double* const to_cov = cov.mutable_data();
  bool* const to_inside = inside.mutable_data();
  {
    const py::gil_scoped_release other_threads_may_run;
    for (py::ssize_t i = 0; i < n; ++i) {
      const auto error = document.model.error_at(Vector3(at + 3 * i), tool, travel);
      Eigen::Map<Vector3>(to_V + 3 * i) = error.V_m;
      // the matrix is symmetric, so the order of its elements does not matter
      Eigen::Map<calib::Matrix3>(to_cov + 9 * i) = error.cov_V_m2;
      to_inside[i] = error.inside && error.tool_ok;
    }
  }
  return py::make_tuple(V, cov, inside);
}

/// Raises abbe.Error "refused" if the model must not correct a machine, unless it is forced with a
/// reason.
void require_use(const ModelDocument& document, bool force, const std::string& why) {
  if (force && why.empty()) refuse("force: needs why, the reason");
  const auto found = daemon::obstacles_to_use({.document = document});
  if (found.refusals.empty() || force) return;
  throw Raised({daemon::ErrorCode::Refused,
                "correction_at: the model must not be used; to use it nevertheless, give "
                "force=True and why",
                found.refusals});
}

/// The verdict in a model file; None: not judged.
py::object verdict_of(const ModelDocument& document) {
  const auto& verdict = document.verdict;
  if (!verdict) return py::none();
  py::dict out;
  out["state"] = std::string{daemon::name(daemon::state_of(verdict))};
  out["reasons"] = verdict->reasons;
  out["notes"] = verdict->notes;
  out["forced_by"] = verdict->forced ? verdict->forced->who : std::string{};
  out["forced_why"] = verdict->forced ? verdict->forced->why : std::string{};
  return out;
}

std::vector<std::string> statements_of(const ModelDocument& document) {
  return daemon::obstacles_to_use({.document = document, .purpose = daemon::ModelPurpose::Look})
      .statements;
}

/// Returns (c_m (N, 3), inside (N)).
py::tuple correction_at(const ModelDocument& document, const Points& points_m,
                        const std::optional<Vector3>& tool_m, const Direction& direction,
                        bool force, const std::string& why) {
  require_use(document, force, why);
  const py::ssize_t n = rows_of(points_m, "points_m");
  const Vector3 tool = tool_of(document, tool_m);
  const auto travel = travel_of(document, direction);
  py::array_t<double> c({n, py::ssize_t{3}});
  py::array_t<bool> inside(n);
  const double* const at = points_m.data();
  double* const to_c = c.mutable_data();
  bool* const to_inside = inside.mutable_data();
  std::optional<daemon::Error> fault;
  {
    const py::gil_scoped_release other_threads_may_run;
    for (py::ssize_t i = 0; i < n && !fault; ++i) {
      const auto found = document.model.command_correction(Vector3(at + 3 * i), tool, travel);
      if (!found) {
        fault = daemon::error_of(found.error());
        continue;
      }
      Eigen::Map<Vector3>(to_c + 3 * i) = found->c_m;
      to_inside[i] = found->inside;
    }
  }
  if (fault) throw Raised(*fault);
  return py::make_tuple(c, inside);
}

/// Returns the columns name, position_m, value and u, with one row for each parameter.
py::dict parameters_of(const ModelDocument& document) {
  const auto parameters = document.model.parameters();
  const auto& covariance = document.model.covariance();
  const auto n = static_cast<py::ssize_t>(parameters.size());
  py::list names;
  py::array_t<double> position(n), value(n), u(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    const auto& p = parameters[static_cast<std::size_t>(i)];
    names.append(p.name);
    position.mutable_at(i) = p.position_m.value_or(std::numeric_limits<double>::quiet_NaN());
    value.mutable_at(i) = p.value;
    u.mutable_at(i) = std::sqrt(covariance(i, i));
  }
  py::dict out;
  out["name"] = py::module_::import("numpy").attr("array")(names);
  out["position_m"] = position;
  out["value"] = value;
  out["u"] = u;
  return out;
}

}  // namespace

void bind_model(py::module_& module) {
  py::class_<ModelDocument>(module, "Model")
      .def_static(
          "load",
          [](const std::string& file) {
            return value_or_raise([&file] {
              const py::gil_scoped_release other_threads_may_run;
              return daemon::read_model(file);
            }());
          },
          py::arg("file"))
      .def_property_readonly("id", [](const ModelDocument& d) { return daemon::model_id(d); })
      .def_property_readonly("hash", [](const ModelDocument& d) { return daemon::model_hash(d); })
      .def_property_readonly("machine", [](const ModelDocument& d) { return d.machine; })
      .def_property_readonly("method", [](const ModelDocument& d) { return d.method; })
      .def_property_readonly(
          "simulated", [](const ModelDocument& d) { return daemon::made_on_simulated_devices(d); })
      .def_property_readonly("estimator", [](const ModelDocument& d) { return d.estimator; })
      .def_property_readonly(
          "created_utc_ns",
          [](const ModelDocument& d) { return d.created.time_since_epoch().count(); })
      .def_property_readonly(
          "chain", [](const ModelDocument& d) { return std::string{d.model.chain().text()}; })
      .def_property_readonly(
          "tool_offsets_m",
          [](const ModelDocument& d) { return table_of(d.model.tool_offsets_m()); })
      .def_property_readonly(
          "validity_hull_m",
          [](const ModelDocument& d) {
            const auto vertices = d.model.validity().vertices_m();
            return table_of(std::vector<Vector3>(vertices.begin(), vertices.end()));
          })
      .def_property_readonly("parameters", parameters_of)
      .def_property_readonly("covariance",
                             [](const ModelDocument& d) { return d.model.covariance(); })
      .def("error_at", error_at, py::arg("points_m"), py::arg("tool_m") = py::none(),
           py::arg("direction") = py::none())
      .def_property_readonly("verdict", verdict_of)
      .def_property_readonly("statements", statements_of)
      .def("correction_at", correction_at, py::arg("points_m"), py::arg("tool_m") = py::none(),
           py::arg("direction") = py::none(), py::arg("force") = false, py::arg("why") = "");
}

}  // namespace abbe::python
