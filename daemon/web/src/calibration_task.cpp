#include "calibration_task.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/methods/evemu/task_of_files.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using nlohmann::json;

/// A file that the browser read.
struct SentFile {
  std::string name, text;
};

SentFile sent_file(const json& body, const char* member) {
  const json& file = body.at(member);
  return {file.at("file").get<std::string>(), file.at("text").get<std::string>()};
}

Result<json> otf_task(const json& body) {
  const SentFile file = sent_file(body, "path");
  const auto path = daemon::parse_path_csv(file.text, file.name);
  ABBE_TRY(path);
  json task{{"method", "otf"}, {"path_m", path->vertices_m}};
  if (body.contains("mode")) task["mode"] = body["mode"];
  return task;
}

Result<json> array_task(const json& body) {
  const SentFile file = sent_file(body, "calibrator");
  const auto calibrator = daemon::parse_calibrator_toml(file.text, file.name);
  ABBE_TRY(calibrator);
  std::optional<daemon::BallErrorsFile> reference;
  if (body.contains("reference")) {
    const SentFile errors = sent_file(body, "reference");
    auto parsed = daemon::parse_errors_csv(errors.text, errors.name);
    ABBE_TRY(parsed);
    reference = std::move(*parsed);
  }

  if (!reference) return daemon::evemu_task(*calibrator, nullptr, 0.0);

  const double u_um = body.value("u_reference_um", 0.0);
  if (!std::isfinite(u_um) || u_um <= 0.0)
    return daemon::fail(ErrorCode::Usage,
                        "u_reference_um: give the standard uncertainty of the V in the reference "
                        "file, in um: more than 0");
  return daemon::evemu_task(*calibrator, &*reference, u_um / daemon::kUmPerM);
}

}  // namespace

Result<json> calibration_task(const json& body) {
  const auto method = body.at("method").get<std::string>();
  Result<json> task = daemon::fail(ErrorCode::Usage,
                                   fmt::format("method \"{}\": must be otf, evemu or mfb", method));
  if (method == "otf") task = otf_task(body);
  if (method == "evemu") task = array_task(body);
  if (method == "mfb")  // abbed reads the files itself
    task = json{{"method", "mfb"}, {"bar", body.at("bar")}, {"plan", body.at("plan")}};
  if (task) (*task)["do"] = "calibrate";
  return task;
}

}  // namespace abbe::web
