#include "machine_touching.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/result/try.hpp"
#include "daemon_socket.hpp"
#include "interruption.hpp"
#include "machine_stop.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using std::chrono::steady_clock;

constexpr auto kTouchPollPeriod = 200ms;

json as_json(const std::vector<calib::Vector3>& path) {
  json positions = json::array();
  for (const auto& p : path) positions.push_back({p.x(), p.y(), p.z()});
  return positions;
}

json as_json(const calib::MachineTouches& plan) {
  json points = json::array();
  for (const auto& touch : plan.touches) {
    points.push_back({{"way", as_json(touch.way_m)},
                      {"at_m", {touch.at_m.x(), touch.at_m.y(), touch.at_m.z()}},
                      {"normal", {touch.normal.x(), touch.normal.y(), touch.normal.z()}}});
  }
  return {{"do", "touch"}, {"points", std::move(points)}, {"leave", as_json(plan.leave_m)}};
}

TouchesMade made_of(const json& answer, std::size_t asked) {
  TouchesMade out{{}, 0.0, answer["reason"]};
  if (answer.contains("stop"))
    if (const auto stopped = stop_outcome(answer["stop"]); !stopped)
      out.code = stopped.error().code;
  for (const json& t : answer["touches"]) {
    if (out.places_m.size() == asked) break;
    const auto p = t["at_m"].get<std::array<double, 3>>();
    out.places_m.emplace_back(p[0], p[1], p[2]);
    out.u_position_m = t["u_m"];
  }
  return out;
}

/// Cancels the touching. True if the daemon touches no more: it has cancelled, or it refused the
/// request because no touching was running.
bool cancel(const std::filesystem::path& socket) {
  const auto answer = ask_daemon(socket, {{"do", "touch"}, {"cancel", true}});
  return answer || answer.error().code == ErrorCode::Refused;
}

TouchesMade follow_touches(const std::filesystem::path& socket, std::size_t asked) {
  ProgressBar bar;
  TouchesMade so_far;
  bool cancelled = false;

  for (auto answered = steady_clock::now();; std::this_thread::sleep_for(kTouchPollPeriod)) {
    if (interrupted() && !cancelled) cancelled = cancel(socket);
    const auto answer = ask_daemon(socket, {{"do", "touches"}});
    if (!answer) {
      if (steady_clock::now() - answered < kDaemonTimeout) continue;
      (void)cancel(socket);
      so_far.reason = fmt::format("{}: the machine may be moving", answer.error().text);
      so_far.code = ErrorCode::StopNotConfirmed;
      return so_far;
    }

    answered = steady_clock::now();
    TouchesMade now = made_of(*answer, asked);
    const bool running = (*answer)["running"].get<bool>();
    const bool other_plan = (*answer)["asked"] != asked ||
                            now.places_m.size() < so_far.places_m.size() ||
                            (!running && now.reason.empty() && now.places_m.size() < asked);
    if (other_plan) {
      so_far.reason =
          "the touches are lost: the daemon restarted, or another client has begun a touching; run "
          "the command again";
      return so_far;
    }

    so_far = std::move(now);
    if (!running) return so_far;
    bar.show("touching", static_cast<double>(so_far.places_m.size()) / static_cast<double>(asked));
  }
}

}  // namespace

Result<calib::Vector3> machine_position(const std::filesystem::path& socket) {
  const auto answer = ask_daemon(socket, {{"do", "touch"}, {"where", true}});
  ABBE_TRY(answer);
  const auto p = (*answer)["at_m"].get<std::array<double, 3>>();
  return calib::Vector3{p[0], p[1], p[2]};
}

Result<TouchesMade> make_touches(const std::filesystem::path& socket,
                                 const calib::MachineTouches& touches) {
  mark_interruptions({SIGINT, SIGTERM, SIGHUP, SIGQUIT});
  const auto started = ask_daemon(socket, as_json(touches));
  if (!started) {
    // Io: no answer arrived, but the daemon may have started the touching.
    if (started.error().code == ErrorCode::Io) (void)cancel(socket);
    return tl::unexpected(started.error());
  }
  return follow_touches(socket, touches.touches.size());
}

}  // namespace abbe::daemon
