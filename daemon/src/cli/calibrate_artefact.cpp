/// `abbe calibrate artefact`: a ball array measured by the measuring machine of the running daemon: touched
/// where its nominal description says, fitted, and written as calibrator.toml with uncertainties.

#include <fmt/format.h>
#include <signal.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <thread>
#include <utility>

#include "abbe/calib/evemu/artefact_touches.hpp"
#include "abbe/daemon/control_protocol.hpp"
#include "abbe/daemon/evemu_files.hpp"
#include "abbe/daemon/otf_inputs.hpp"
#include "cli/commands.hpp"
#include "cli/daemon_socket.hpp"
#include "cli/terminal.hpp"
#include "files/text_file.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;
using namespace std::chrono_literals;
using nlohmann::json;

constexpr auto kLookAtTouches = 200ms;

struct CalibrateArtefactArguments {
  DaemonSocket where;
  std::string calibrator, touches, out = "calibrator.toml";
  std::vector<double> at_mm{0.0, 0.0, 0.0};
  double turn_deg = 0.0;
  std::size_t points = 13, face_points = 9;
  double clearance_mm = 5.0;
  bool json = false;
};

/// The nominal artefact where it stands on the machine's table.
struct Placed {
  evemu::Calibrator nominal;
  std::array<evemu::FaceToTouch, 2> faces;
};

Result<Placed> placed(const CalibrateArtefactArguments& arguments) {
  const auto file = read_calibrator_toml(arguments.calibrator);
  if (!file) return tl::unexpected(file.error());
  const double turn_rad = arguments.turn_deg * std::numbers::pi / 180.0;
  const auto& at = arguments.at_mm;
  const calib::RigidTransform T_machine_artefact{
      Eigen::AngleAxisd(turn_rad, calib::Vector3::UnitZ()).toRotationMatrix(),
      1e-3 * calib::Vector3{at[0], at[1], at[2]}};
  Placed out{evemu::moved(file->calibrator, T_machine_artefact), {}};
  for (std::size_t i = 0; i < out.faces.size(); ++i) {
    if (!file->faces[i]) {
      return fail(ErrorCode::BadInput,
                  fmt::format("{}: block {}: x_mm, y_mm, z_mm are missing: the middle of "
                              "the face that is to be touched",
                              arguments.calibrator, i + 1));
    }
    out.faces[i] = {T_machine_artefact.R * file->faces[i]->centre_m + T_machine_artefact.t_m,
                    file->faces[i]->half_size_m};
  }
  return out;
}

json as_json(const std::vector<evemu::PlannedTouch>& plan) {
  const auto three = [](const calib::Vector3& v) { return json{v.x(), v.y(), v.z()}; };
  json points = json::array();
  for (const auto& touch : plan) {
    json way = json::array();
    for (const auto& place : touch.way_m) way.push_back(three(place));
    points.push_back({{"way", std::move(way)}, {"at_m", three(touch.at_m)}, {"normal", three(touch.normal)}});
  }
  return points;
}

/// What the machine made of the plan; `reason` is empty when it made all of it.
struct Touched {
  std::vector<evemu::Touch> touches;
  double u_position_m = 0.0;
  std::string reason;
};

Touched touched(const json& answer, const std::vector<evemu::PlannedTouch>& plan) {
  Touched out{{}, 0.0, answer["reason"]};
  for (const json& t : answer["touches"]) {
    const auto& planned = plan[out.touches.size()];
    const auto p = t["at_m"].get<std::array<double, 3>>();
    out.touches.push_back(
        {.position = 1, .feature = planned.feature, .number = planned.number, .p_m = {p[0], p[1], p[2]}});
    out.u_position_m = t["u_m"];
    if (out.touches.size() == plan.size()) break;
  }
  return out;
}

volatile std::sig_atomic_t touching_interrupted = 0;  // written by the signal handler

/// A machine that nobody watches any more must not go on moving.
void end_touches_on_interrupt() {
  struct sigaction end {};
  end.sa_handler = [](int) { touching_interrupted = 1; };
  ::sigaction(SIGINT, &end, nullptr);
  ::sigaction(SIGTERM, &end, nullptr);
}

Result<Touched> touch(const std::filesystem::path& socket, const std::vector<evemu::PlannedTouch>& plan) {
  end_touches_on_interrupt();
  const auto started = ask_daemon(socket, {{"do", "touch"}, {"points", as_json(plan)}});
  if (!started) return tl::unexpected(started.error());
  ProgressBar bar;
  Touched so_far;
  for (bool told = false;; std::this_thread::sleep_for(kLookAtTouches)) {
    if (touching_interrupted != 0 && !std::exchange(told, true))
      (void)ask_daemon(socket, {{"do", "touch"}, {"cancel", true}});
    const auto answer = ask_daemon(socket, {{"do", "touches"}});
    if (!answer) {
      so_far.reason = answer.error().text;
      return so_far;
    }
    so_far = touched(*answer, plan);
    if (!(*answer)["running"].get<bool>()) return so_far;
    bar.show("touching", static_cast<double>(so_far.touches.size()) / static_cast<double>(plan.size()));
  }
}

Result<void> keep(const Touched& touched, const std::string& file) {
  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  for (const auto& t : touched.touches) {
    text += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n", t.position,
                        t.feature == evemu::Feature::Ball ? "ball" : "block", t.number, 1e3 * t.p_m.x(),
                        1e3 * t.p_m.y(), 1e3 * t.p_m.z());
  }
  return replace_file(file, text);
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
  if (arguments.json) fmt::print("{}\n", json{{"calibrator", arguments.out}, {"balls", balls}}.dump(1));
  return 0;
}

int calibrate(CalibrateArtefactArguments arguments) {
  if (arguments.touches.empty())
    arguments.touches = std::filesystem::path(arguments.out).replace_extension(".touches.csv").string();
  const auto artefact = placed(arguments);
  if (!artefact) return report(artefact.error());
  const auto plan = evemu::plan_artefact_touches(artefact->nominal, artefact->faces,
                                                 {.points_per_ball = arguments.points,
                                                  .points_per_face = arguments.face_points,
                                                  .clearance_m = 1e-3 * arguments.clearance_mm});
  if (!plan) return report({ErrorCode::Usage, plan.error().text, {}});
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto made = touch(*socket, *plan);
  if (!made) return report(made.error());
  if (const auto kept = keep(*made, arguments.touches); !kept) return report(kept.error());
  if (!made->reason.empty()) {
    return report({ErrorCode::DataInsufficient,
                   made->reason,
                   {fmt::format("{} touches until then: {}", made->touches.size(), arguments.touches)}});
  }
  const auto found =
      evemu::calibrated_artefact(artefact->nominal, artefact->faces, made->touches, made->u_position_m);
  if (!found) return report(error_of(found.error()));
  std::array<std::optional<BlockFace>, 2> faces;
  for (std::size_t i = 0; i < faces.size(); ++i)
    faces[i] = BlockFace{artefact->faces[i].centre_m, artefact->faces[i].half_size_m};
  const auto text = calibrator_toml(
      *found, faces,
      fmt::format("# measured with {} touches: {}; in the coordinates of the measuring machine\n"
                  "# u: standard uncertainty (k = 1), of the fit and of the machine\n",
                  made->touches.size(), std::filesystem::path(arguments.touches).filename().string()));
  if (const auto written = replace_file(arguments.out, text); !written) return report(written.error());
  return print(*found, artefact->nominal, arguments);
}

}  // namespace

void add_calibrate_artefact(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateArtefactArguments>();
  auto* command = parent.add_subcommand(
      "artefact",
      "A ball array on the measuring machine of the running daemon ([cmm]): touches its balls on their "
      "upper\n"
      "half and its blocks on the faces that the file names, and writes it as measured, with uncertainties.\n"
      "The machine moves: the ways lead around the balls and above everything, around nothing else.\n"
      "Ctrl-C ends it after the touch that is under way. Exit code 1 then, and when a touch was refused or "
      "the\n"
      "machine or the daemon went away: the touches until then are kept.");
  command
      ->add_option("--calibrator", arguments->calibrator,
                   "nominal description: calibrator.toml, its blocks with x_mm, y_mm, z_mm, half_size_mm")
      ->required();
  command->add_option("-o,--output", arguments->out, "the artefact as measured")->capture_default_str();
  command->add_option("--touches", arguments->touches, "where the touches go (default: beside the output)");
  command->add_option("--at", arguments->at_mm, "where the artefact's origin stands, mm: x,y,z")
      ->delimiter(',')
      ->expected(3);
  command->add_option("--turn", arguments->turn_deg, "how far it is turned about z, degrees");
  command->add_option("--points", arguments->points, "on a ball, at least 5")->capture_default_str();
  command->add_option("--block-points", arguments->face_points, "on a block's face, at least 4")
      ->capture_default_str();
  command->add_option("--clearance", arguments->clearance_mm, "of the tip on its ways, mm")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  add_socket_options(*command, arguments->where);
  command->add_flag("--json", arguments->json, "the result as JSON");
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
