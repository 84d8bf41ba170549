// Use cases of the command line: identify from files, verify, plan, export. They call the same
// functions as the command line.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/base/text_file.hpp"
#include "abbe/tasks/effect_name.hpp"
#include "abbe/tasks/export_model.hpp"
#include "abbe/tasks/identify_evemu.hpp"
#include "abbe/tasks/identify_joint.hpp"
#include "abbe/tasks/identify_mfb.hpp"
#include "abbe/tasks/identify_otf.hpp"
#include "abbe/tasks/plan_otf.hpp"
#include "abbe/tasks/verify.hpp"
#include "bindings.hpp"
#include "raise.hpp"

namespace py = pybind11;

namespace abbe::python {
namespace {

using daemon::ModelDocument;

/// Runs a task while the lock of the Python interpreter is released.
template <class Task>
auto without_lock(const Task& task) {
  return value_or_raise([&task] {
    const py::gil_scoped_release other_threads_may_run;
    return task();
  }());
}

ModelDocument judged(ModelDocument document, const calib::Verdict& verdict) {
  document.verdict = daemon::model_verdict(verdict);
  return document;
}

ModelDocument identify_otf(const daemon::IdentifyOtfArguments& arguments) {
  auto outcome =
      without_lock([&] { return daemon::identify_otf_from(arguments, daemon::Progress{}); });
  return judged(std::move(outcome.document), outcome.verdict);
}

ModelDocument identify_evemu(const daemon::IdentifyEvemuArguments& arguments) {
  auto outcome = without_lock([&] { return identify_evemu(arguments, daemon::Progress{}); });
  return judged(std::move(outcome.document), outcome.candidate.verdict);
}

ModelDocument identify_mfb(const daemon::IdentifyMfbArguments& arguments) {
  auto outcome = without_lock([&] { return identify_mfb(arguments, daemon::Progress{}); });
  return judged(std::move(outcome.document), outcome.candidate.verdict);
}

ModelDocument identify_joint(const daemon::IdentifyJointArguments& arguments) {
  auto found = without_lock([&] { return identify_joint(arguments, daemon::Progress{}); });
  if (auto* contradiction = std::get_if<daemon::JointContradiction>(&found))
    throw Raised({daemon::ErrorCode::DataInsufficient,
                  "identify joint: the parts contradict each other, there is no joint model",
                  std::move(contradiction->identified.contradictions)});
  auto& outcome = std::get<daemon::JointOutcome>(found);
  return judged(std::move(outcome.document), outcome.verdict);
}

py::dict lengths_of(const calib::VectorStatistics& s) {
  py::dict out;
  out["mean_m"] = s.mean_m;
  out["rms_m"] = s.rms_m;
  out["max_m"] = s.max_m;
  return out;
}

void add_effect(py::dict& out, const daemon::ModelAtPoints& one) {
  out["effect"] = daemon::effect_name(calib::verify::effect_at_points(one.comparison));
  out["before"] = lengths_of(one.comparison.before);
  out["after"] = lengths_of(one.comparison.after);
  out["cautions"] = one.model.cautions;
}

py::list effects_of(const std::vector<daemon::ModelAtPoints>& models) {
  py::list out;
  for (const auto& one : models) {
    py::dict entry;
    entry["name"] = one.model.name;
    entry["model"] = model_id(one.model.document);
    entry["machine"] = one.model.machine;
    add_effect(entry, one);
    out.append(std::move(entry));
  }
  return out;
}

/// `as_list`: the result is a list with one entry per model.
py::dict verify(const daemon::VerifyArguments& arguments, bool as_list) {
  std::optional<daemon::Error> cut_short;
  const auto v = without_lock([&] {
    auto verified = verify_models(arguments, cut_short, daemon::Progress{});
    if (!verified && cut_short) verified.error().details.push_back(cut_short->text);
    return verified;
  });
  py::dict out;
  out["places"] = v.observations.shots.size();
  out["inside"] = v.inside;
  if (as_list)
    out["models"] = effects_of(v.models);
  else
    add_effect(out, v.models.front());
  out["points_off"] = v.points_off;
  out["likely_mistakes"] = v.likely_mistakes;
  out["cut_short"] = v.cut_short;
  return out;
}

py::dict prediction_of(const calib::otf::Prediction& p) {
  py::dict out;
  out["rms_u_m"] = p.rms_u_m;
  out["max_u_m"] = p.max_u_m;
  out["length_m"] = p.length_m;
  out["duration_s"] = p.duration_s;
  return out;
}

py::dict plan_otf(const daemon::PlanOtfArguments& arguments) {
  const auto plan = without_lock([&] { return plan_otf(arguments, daemon::Progress{}); });
  const auto& vertices = plan.path.vertices_m;
  py::array_t<double> table({static_cast<py::ssize_t>(vertices.size()), py::ssize_t{3}});
  auto to = table.mutable_unchecked<2>();
  for (std::size_t i = 0; i < vertices.size(); ++i)
    for (int k = 0; k < 3; ++k) to(static_cast<py::ssize_t>(i), k) = vertices[i][k];

  py::dict out;
  out["vertices_m"] = table;
  out["tracker_m"] = plan.run.tracker_m;
  out["prediction"] = prediction_of(plan.prediction);
  return out;
}

/// Exports a model and returns the report that `abbe export --json` prints.
py::object export_model(const daemon::ExportArguments& arguments) {
  const auto done = without_lock([&] {
    return export_model(arguments, [](const std::string&, const daemon::FoundModel&) {});
  });
  return py::module_::import("json").attr("loads")(daemon::report_json(done));
}

void save(const ModelDocument& document, const std::string& file) {
  without_lock([&]() -> daemon::Result<bool> {
    return daemon::replace_file(file, daemon::to_json(document)).map([] { return true; });
  });
}

std::string text_or_empty(const std::optional<std::string>& text) {
  return text.value_or(std::string{});
}

using Text = std::optional<std::string>;
using OneOrSeveral = std::variant<std::string, std::vector<std::string>>;

void bind_identify_otf(py::module_& module) {
  module.def(
      "identify_otf",
      [](const Text& machine, const Text& path, const Text& tracker, const Text& encoder,
         const Text& recording, const std::vector<std::string>& targets,
         const std::vector<std::string>& tracker_centres_mm, const Text& mode,
         const Text& estimator, const Text& tables, const Text& backlash, const Text& smoothness,
         std::optional<double> u_scale_ppm, bool scales_corrected, bool accept_path_orientation,
         const Text& compare_with) {
        daemon::IdentifyOtfArguments arguments;
        arguments.machine = text_or_empty(machine);
        arguments.path = text_or_empty(path);
        arguments.tracker = text_or_empty(tracker);
        arguments.encoder = text_or_empty(encoder);
        arguments.recording = text_or_empty(recording);
        arguments.targets = targets;
        arguments.tracker_centres = tracker_centres_mm;
        arguments.accept_path_orientation = accept_path_orientation;
        arguments.mode = text_or_empty(mode);
        arguments.estimator = estimator;
        arguments.tables = text_or_empty(tables);
        arguments.backlash = text_or_empty(backlash);
        arguments.smoothness = text_or_empty(smoothness);
        arguments.u_scale_ppm = u_scale_ppm;
        arguments.scales_corrected = scales_corrected;
        arguments.keep = text_or_empty(compare_with);
        return identify_otf(arguments);
      },
      py::kw_only(), py::arg("machine") = py::none(), py::arg("path") = py::none(),
      py::arg("tracker") = py::none(), py::arg("encoder") = py::none(),
      py::arg("recording") = py::none(), py::arg("targets") = std::vector<std::string>{},
      py::arg("tracker_centres_mm") = std::vector<std::string>{}, py::arg("mode") = py::none(),
      py::arg("estimator") = py::none(), py::arg("tables") = py::none(),
      py::arg("backlash") = py::none(), py::arg("smoothness_um") = py::none(),
      py::arg("u_scale_ppm") = py::none(), py::arg("scales_corrected") = false,
      py::arg("accept_path_orientation") = false, py::arg("compare_with") = py::none());
}

void bind_identify_touches(py::module_& module) {
  module.def(
      "identify_evemu",
      [](const Text& machine, const Text& touches, const Text& calibrator, const Text& errors,
         const Text& recording, const Text& rotation_reference,
         std::optional<double> u_reference_um, std::optional<double> artefact_C,
         std::optional<double> u_artefact_K, const Text& estimator, const Text& folds,
         std::optional<int> order, bool scales_corrected, const Text& compare_with) {
        daemon::IdentifyEvemuArguments arguments;
        arguments.input.machine = text_or_empty(machine);
        arguments.input.touches = text_or_empty(touches);
        arguments.input.calibrator = text_or_empty(calibrator);
        arguments.input.errors = text_or_empty(errors);
        arguments.input.recording = text_or_empty(recording);
        arguments.input.order = order;
        arguments.folds = folds;
        arguments.input.rotation_reference = text_or_empty(rotation_reference);
        arguments.input.u_reference_um = u_reference_um;
        arguments.input.artefact_C = artefact_C;
        arguments.input.u_artefact_K = u_artefact_K;
        arguments.input.scales_corrected = scales_corrected;
        arguments.estimator = estimator;
        arguments.keep = text_or_empty(compare_with);
        return identify_evemu(arguments);
      },
      py::kw_only(), py::arg("machine") = py::none(), py::arg("touches") = py::none(),
      py::arg("calibrator") = py::none(), py::arg("errors") = py::none(),
      py::arg("recording") = py::none(), py::arg("rotation_reference") = py::none(),
      py::arg("u_reference_um") = py::none(), py::arg("artefact_C") = py::none(),
      py::arg("u_artefact_K") = py::none(), py::arg("estimator") = py::none(),
      py::arg("folds") = py::none(), py::arg("order") = py::none(),
      py::arg("scales_corrected") = false, py::arg("compare_with") = py::none());
  module.def(
      "identify_mfb",
      [](const Text& machine, const Text& bar, const Text& plan, const Text& points,
         const Text& recording, const Text& estimator, bool scales_corrected,
         const Text& compare_with) {
        daemon::IdentifyMfbArguments arguments;
        arguments.machine = text_or_empty(machine);
        arguments.bar = text_or_empty(bar);
        arguments.plan = text_or_empty(plan);
        arguments.points = text_or_empty(points);
        arguments.recording = text_or_empty(recording);
        if (estimator) arguments.estimator = *estimator;
        arguments.scales_corrected = scales_corrected;
        arguments.keep = text_or_empty(compare_with);
        return identify_mfb(arguments);
      },
      py::kw_only(), py::arg("machine") = py::none(), py::arg("bar") = py::none(),
      py::arg("plan") = py::none(), py::arg("points") = py::none(),
      py::arg("recording") = py::none(), py::arg("estimator") = py::none(),
      py::arg("scales_corrected") = false, py::arg("compare_with") = py::none());
  module.def(
      "identify_joint",
      [](const std::string& machine, const std::string& parts, const Text& estimator,
         const Text& compare_with) {
        daemon::IdentifyJointArguments arguments;
        arguments.machine = machine;
        arguments.parts = parts;
        arguments.estimator = estimator;
        arguments.keep = text_or_empty(compare_with);
        return identify_joint(arguments);
      },
      py::kw_only(), py::arg("machine"), py::arg("parts"), py::arg("estimator") = py::none(),
      py::arg("compare_with") = py::none());
}

}  // namespace

void bind_identify(py::module_& module) {
  bind_identify_otf(module);
  bind_identify_touches(module);
  module.def("save_model", &save, py::arg("model"), py::arg("file"));
  module.def(
      "verify",
      [](const OneOrSeveral& model, const Text& points, const Text& recording, const Text& store,
         const Text& tool_mm) {
        daemon::VerifyArguments arguments;
        const auto* const one = std::get_if<std::string>(&model);
        arguments.models = one ? std::vector{*one} : std::get<std::vector<std::string>>(model);
        arguments.points = text_or_empty(points);
        arguments.recording = text_or_empty(recording);
        if (store) arguments.store.folder = *store;
        arguments.tool = text_or_empty(tool_mm);
        if (arguments.points.empty() == arguments.recording.empty())
          throw Raised({daemon::ErrorCode::Usage, "verify: give points or recording", {}});
        return verify(arguments, one == nullptr);
      },
      py::arg("model"), py::kw_only(), py::arg("points") = py::none(),
      py::arg("recording") = py::none(), py::arg("store") = py::none(),
      py::arg("tool_mm") = py::none());
  module.def(
      "plan_otf",
      [](const std::string& machine, const std::vector<std::string>& trackers_at_mm,
         std::optional<double> length_m, std::optional<double> duration_min,
         double feed_mm_per_min) {
        daemon::PlanOtfArguments arguments;
        arguments.machine = machine;
        arguments.trackers = trackers_at_mm;
        arguments.length_m = length_m;
        arguments.budget_min = duration_min;
        arguments.feed_mm_per_min = feed_mm_per_min;
        return plan_otf(arguments);
      },
      py::kw_only(), py::arg("machine"), py::arg("trackers_at_mm") = std::vector<std::string>{},
      py::arg("length_m") = py::none(), py::arg("duration_min") = py::none(),
      py::arg("feed_mm_per_min") = daemon::PlanOtfArguments{}.feed_mm_per_min);
  module.def(
      "export_model",
      [](const std::string& model, const std::string& to, const std::string& out, const Text& store,
         const Text& tool_mm, std::optional<double> step_mm, const Text& positive, bool force,
         const std::string& why) {
        daemon::ExportArguments arguments;
        arguments.model = model;
        arguments.to = to;
        arguments.out = out;
        if (store) arguments.store.folder = *store;
        arguments.tool = text_or_empty(tool_mm);
        arguments.step_mm = step_mm;
        arguments.positive = text_or_empty(positive);
        arguments.force = {force, why};
        return export_model(arguments);
      },
      py::arg("model"), py::kw_only(), py::arg("to"), py::arg("out"), py::arg("store") = py::none(),
      py::arg("tool_mm") = py::none(), py::arg("step_mm") = py::none(),
      py::arg("positive") = py::none(), py::arg("force") = false, py::arg("why") = "");
}

}  // namespace abbe::python
