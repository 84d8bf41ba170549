/// `abbe calibrate artefact`: calibrates a ball array on the measuring machine of the running
/// daemon. It touches balls and block faces at their nominal places, fits spheres and planes, and
/// writes calibrator.toml with uncertainties.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "abbe/base/json_text.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/calib/evemu/plan/artefact_touches.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "machine_touching.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;
using nlohmann::json;

struct CalibrateArtefactArguments {
  DaemonSocket where;
  std::string calibrator, touches, out = "calibrator.toml";
  std::vector<double> at_mm;
  double turn_deg = 0.0;
  std::size_t points = 13, face_points = 9;
  double clearance_mm = 5.0;
  bool json = false;
};

/// The nominal artefact in the coordinates of the machine.
struct Placed {
  evemu::Calibrator nominal;
  std::array<evemu::FaceToTouch, 2> faces;
};

Result<Placed> placed(const CalibrateArtefactArguments& arguments) {
  const auto file = read_calibrator_toml(arguments.calibrator);
  ABBE_TRY(file);
  const double turn_rad = arguments.turn_deg * std::numbers::pi / 180.0;
  const auto& at = arguments.at_mm;
  const calib::RigidTransform T_machine_artefact{
      Eigen::AngleAxisd(turn_rad, calib::Vector3::UnitZ()).toRotationMatrix(),
      1e-3 * calib::Vector3{at[0], at[1], at[2]}};
  Placed out{evemu::moved(file->calibrator, T_machine_artefact), {}};

  for (std::size_t i = 0; i < out.faces.size(); ++i) {
    if (!file->faces[i]) {
      return fail(ErrorCode::BadInput,
                  fmt::format("{}: block {}: x_mm, y_mm, z_mm are missing: add the middle of "
                              "the face to be touched",
                              arguments.calibrator, i + 1));
    }
    out.faces[i] = {T_machine_artefact.R * file->faces[i]->centre_m + T_machine_artefact.t_m,
                    file->faces[i]->half_size_m};
  }

  return out;
}

/// The touches that were made; `reason` is empty if the whole plan was executed.
struct Touched {
  std::vector<evemu::Touch> touches;
  double u_position_m = 0.0;
  std::string reason;
  ErrorCode code = ErrorCode::DataInsufficient;  ///< error code that belongs to `reason`
};

Result<Touched> touch_artefact(const std::filesystem::path& socket,
                               const evemu::ArtefactPlan& plan) {
  const auto made =
      make_touches(socket, {{plan.touches.begin(), plan.touches.end()}, plan.leave_m});
  ABBE_TRY(made);
  Touched out{{}, made->u_position_m, made->reason, made->code};
  for (std::size_t i = 0; i < made->places_m.size(); ++i)
    out.touches.push_back({.position = 1,
                           .feature = plan.touches[i].feature,
                           .number = plan.touches[i].number,
                           .p_m = made->places_m[i]});
  return out;
}

Result<void> keep(const Touched& touched, const std::string& file) {
  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  for (const auto& t : touched.touches) {
    text += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n", t.position,
                        t.feature == evemu::Feature::Ball ? "ball" : "block", t.number,
                        1e3 * t.p_m.x(), 1e3 * t.p_m.y(), 1e3 * t.p_m.z());
  }
  return replace_file(file, text);
}

/// Writes the touches of an incomplete run to a separate file and adds its name to the error. The
/// touches file itself stays unchanged, because a calibrator.toml of an earlier run names it.
Error with_partial_touches(Error error, const Touched& touched,
                           const std::filesystem::path& touches) {
  if (touched.touches.empty()) {
    error.details.push_back("no touch was made");
    return error;
  }
  auto file = touches;
  file.replace_extension(".partial" + touches.extension().string());
  const auto kept = keep(touched, file.string());
  error.details.push_back(
      kept ? fmt::format("{} touches were made before: {}", touched.touches.size(), file.string())
           : kept.error().text);
  return error;
}

int print(const evemu::Calibrator& found, const evemu::Calibrator& nominal,
          const CalibrateArtefactArguments& arguments) {
  json balls = json::array();
  for (std::size_t i = 0; i < found.balls.size(); ++i) {
    const auto& ball = found.balls[i];
    const auto& before = nominal.balls[i];
    balls.push_back({{"number", ball.number},
                     {"moved_um", 1e6 * (ball.centre_m - before.centre_m).norm()},
                     {"radius_um", 1e6 * (ball.radius_m - before.radius_m)},
                     {"u_um", 1e6 * ball.u_m}});
    if (!arguments.json)
      fmt::print("ball {}: {:.2f} um from nominal, radius {:+.2f} um, u = {:.2f} um\n", ball.number,
                 balls.back()["moved_um"].get<double>(), balls.back()["radius_um"].get<double>(),
                 1e6 * ball.u_m);
  }

  if (arguments.json)
    fmt::print("{}\n", indented_json_text(json{{"calibrator", arguments.out}, {"balls", balls}}));
  return 0;
}

int calibrate(CalibrateArtefactArguments arguments) {
  if (arguments.touches.empty())
    arguments.touches =
        std::filesystem::path(arguments.out).replace_extension(".touches.csv").string();

  const auto artefact = placed(arguments);
  if (!artefact) return report(artefact.error());
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto tip_m = machine_position(*socket);
  if (!tip_m) return report(tip_m.error());
  const auto plan = evemu::plan_artefact_touches(artefact->nominal, artefact->faces, *tip_m,
                                                 {.points_per_ball = arguments.points,
                                                  .points_per_face = arguments.face_points,
                                                  .clearance_m = 1e-3 * arguments.clearance_mm});
  if (!plan) return report({ErrorCode::Usage, plan.error().text, {}});

  const auto made = touch_artefact(*socket, *plan);
  if (!made) return report(made.error());
  if (!made->reason.empty())
    return report(with_partial_touches(
        {made->code,
         made->reason,
         {"the tip may be low: raise it above artefact and fixture before the next run"}},
        *made, arguments.touches));

  const auto found = evemu::calibrated_artefact(artefact->nominal, artefact->faces, made->touches,
                                                made->u_position_m);
  if (!found)
    return report(with_partial_touches(error_of(found.error()), *made, arguments.touches));
  if (const auto kept = keep(*made, arguments.touches); !kept) return report(kept.error());

  std::array<std::optional<BlockFace>, 2> faces;
  for (std::size_t i = 0; i < faces.size(); ++i)
    faces[i] = BlockFace{artefact->faces[i].centre_m, artefact->faces[i].half_size_m};
  const auto text = calibrator_toml(
      *found, faces,
      fmt::format("# measured with {} touches: {}; in the coordinates of the measuring machine\n"
                  "# u: standard uncertainty (k = 1), of the fit and of the machine\n",
                  made->touches.size(),
                  std::filesystem::path(arguments.touches).filename().string()));
  if (const auto written = replace_file(arguments.out, text); !written)
    return report(written.error());

  return print(*found, artefact->nominal, arguments);
}

}  // namespace

void add_calibrate_artefact(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateArtefactArguments>();
  auto* command = parent.add_subcommand(
      "artefact",
      "Calibrate a ball array on the measuring machine of the "
      "running daemon (" +
          tables_with(Capability::Motion) +
          "): touch the upper half\n"
          "of its balls and the block faces that the file names, and "
          "write the measured array with uncertainties.\n"
          "THE MACHINE MOVES: first straight up from its position, "
          "at the end up again. Its paths lead around\n"
          "the balls and above the whole array; they avoid no other "
          "obstacle. Ctrl-C, a closed terminal, or 2 s\n"
          "without contact between this command and the daemon stop "
          "the machine at once (AbortE); the tip may\n"
          "then be low. Exit code 1 in these cases and if a touch is refused, 6 "
          "or 7 if the machine is not confirmed\n"
          "to be stopped (see abbe machine stop --help): the touches made "
          "before are kept\n"
          "(.partial.csv), files of an earlier run stay unchanged. A run with a "
          "place outside the travel of\n"
          "the machine is refused before it moves (exit code 5).");
  command
      ->add_option(
          "--calibrator", arguments->calibrator,
          "nominal description: calibrator.toml, its blocks with x_mm, y_mm, z_mm, half_size_mm")
      ->required();
  command->add_option("-o,--out", arguments->out, "file for the measured artefact")
      ->capture_default_str();
  command->add_option(
      "--touches", arguments->touches,
      "file for the touches (default: the name of --out with .touches.csv). If the run fails, the\n"
      "touches made so far are in a separate file with .partial.csv");
  command
      ->add_option("--at-mm", arguments->at_mm,
                   "x,y,z: position of the artefact's origin in the machine, mm")
      ->delimiter(',')
      ->expected(3)
      ->required();
  command->add_option("--turn-deg", arguments->turn_deg,
                      "rotation of the artefact about z, degrees");
  command->add_option("--points", arguments->points, "touches per ball, at least 5")
      ->capture_default_str();
  command
      ->add_option("--block-points", arguments->face_points, "touches per block face, at least 4")
      ->capture_default_str();
  command
      ->add_option("--clearance-mm", arguments->clearance_mm,
                   "distance between tip and artefact on the paths, mm")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  add_socket_options(*command, arguments->where);
  command->add_flag("--json", arguments->json, "print the result as JSON");
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
