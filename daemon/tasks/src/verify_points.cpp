#include "verify_points.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/pipeline/standstill_points.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/opened_recording.hpp"
#include "verification_input.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;

/// Saves the points to the folder OUT, if given, before they are evaluated, so that an error in the
/// evaluation does not lose the measurement.
Result<void> keep(const VerifyArguments& arguments, const VerificationFile& points) {
  if (arguments.out.empty()) return {};
  ABBE_TRY(create_folder(arguments.out));
  const auto file = std::filesystem::path(arguments.out) / "verification.csv";
  return replace_file(file, to_verification_csv(points.points));
}

Result<LivePoints> from_file(Result<VerificationFile> points) {
  ABBE_TRY(points);
  return LivePoints{std::move(*points), {}, {}};
}

/// The points of a recording: one for each standstill of the machine.
Result<LivePoints> points_of_recording(const std::string& file, const Progress& progress) {
  const auto recording = open_recording(file);
  ABBE_TRY(recording);
  const Config& config = recording->config;
  if (const auto possible = check_verification(config); !possible)
    return fail(ErrorCode::DataInsufficient, fmt::format("{}: {}", file, possible.error().text));

  StandstillPoints standstills{standstill_options(config)};
  const auto replayed =
      replay(recording->reader, config,
             {.progress = [&progress](double share) { progress.show("replaying", share); },
              .snapshots = [&standstills](const protocol::Snapshot& s) { standstills.take(s); }});
  ABBE_TRY(replayed);
  standstills.finish();

  LivePoints out{{recording->source, {}, {}, 0}, {}, config.machine.name};
  for (const auto& p : standstills.points()) out.file.points.push_back(p.mean);
  if (const auto damage = recording->reader.damage(); !damage.empty())
    out.cut_short = Error{ErrorCode::DataInsufficient, fmt::format("{}: {}", file, damage), {}};

  return out;
}

/// The source of the points and their machine, for the comparison with the machines of the models.
OfMachine of_points(const VerifyArguments& arguments, const std::string& machine) {
  return {arguments.live ? "the daemon" : printable_line(arguments.recording), machine};
}

/// The points, for models of `machines`; sets `different` to the result of different_machines().
Result<LivePoints> points_of(const VerifyArguments& arguments, std::vector<OfMachine> machines,
                             std::string& different, const Progress& progress) {
  const auto accept = [&](const std::string& machine) -> Result<void> {
    if (!machine.empty()) machines.push_back(of_points(arguments, machine));
    auto found = require_same_machine("verify", machines, arguments.other_machine);
    ABBE_TRY(found);
    different = *std::move(found);
    return {};
  };
  if (!arguments.points.empty()) {
    ABBE_TRY(accept({}));
    return from_file(read_verification(arguments));
  }

  const auto keep_them = [&arguments](const VerificationFile& points) {
    return keep(arguments, points);
  };

  if (!arguments.recording.empty()) {
    auto points = points_of_recording(arguments.recording, progress);
    if (!points) return points;
    ABBE_TRY(accept(points->machine));
    ABBE_TRY(keep_them(points->file));
    return points;
  }

  return arguments.live(keep_them, accept);
}

/// The place of a point in messages: "points.csv:9", or "point 8" if it is not from a file.
std::string place_of(const VerificationFile& file, std::size_t point) {
  return point < file.lines.size() ? fmt::format("{}:{}", file.source.name, file.lines[point])
                                   : fmt::format("point {}", point + 1);
}

/// Returns an error that lists the points that do not fit the others; `error` if there are none.
Error with_points_off(Error error, const VerificationFile& file) {
  std::vector<calib::Vector3> measured_m, readings_m;
  for (const auto& point : file.points) {
    measured_m.push_back(point.measured_m);
    readings_m.push_back(point.reading_m);
  }
  const auto off = calib::fit::points_off(measured_m, readings_m);
  if (off.points.empty()) return error;
  return {error.code,
          fmt::format("verification: {} of {} points do not fit the others", off.points.size(),
                      file.points.size()),
          lines_of_points_off(file, off, "correct or delete it")};
}

}  // namespace

Result<LivePoints> points_for(Verification& v, const VerifyArguments& arguments,
                              const Progress& progress) {
  std::vector<OfMachine> machines;
  for (const auto& one : v.models) machines.push_back({one.model.name, one.model.machine});
  auto points = points_of(arguments, std::move(machines), v.different_machines, progress);
  ABBE_TRY(points);
  if (!points->file.source.name.empty()) v.inputs = {points->file.source};
  if (points->file.readings) v.inputs.push_back(*points->file.readings);
  v.lines = points->file.lines;
  v.repeated = points->file.repeated;
  if (points->cut_short) v.cut_short = points->cut_short->text;
  return points;
}

std::vector<std::string> lines_of_points_off(const VerificationFile& file,
                                             const calib::fit::PointsOff& off,
                                             std::string_view advice) {
  std::vector<std::string> lines;
  for (const auto& [point, distance_m] : off.points)
    lines.push_back(fmt::format(
        "{}: alone does not fit: {:.4g} mm off, the others fit within {:.4g} mm rms: {}",
        place_of(file, point), kMmPerM * distance_m, kMmPerM * off.rms_others_m, advice));
  return lines;
}

Result<verify::Observations> observed_in(const VerifyArguments& arguments,
                                         const VerificationFile& file,
                                         const verify::ErrorsAt& errors_at) {
  auto observed = verify::observe(
      file.points, arguments.frame == "fit" ? verify::Frame::BestFit : verify::Frame::Machine,
      errors_at);
  if (!observed) return tl::make_unexpected(with_points_off(error_of(observed.error()), file));
  return std::move(*observed);
}

}  // namespace abbe::daemon
