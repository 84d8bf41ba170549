#include "verification_points.hpp"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/config/json_vector.hpp"
#include "abbe/result/try.hpp"
#include "interruption.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr auto kPointPollPeriod = 200ms;

void print_point(std::size_t number, const json& point) {
  const calib::Vector3 q_mm = 1e3 * vector_of(point.at("reading_m"));
  fmt::print(stderr, "{:>4}: {:.3f}, {:.3f}, {:.3f} mm, {} tracker points, scatter {:.1f} um\n",
             number, q_mm.x(), q_mm.y(), q_mm.z(), point.at("tracker_points").get<std::size_t>(),
             1e6 * point.at("scatter_m").get<double>());
}

/// Requests from the daemon the points that are new since the last call, prints them and stores
/// them in `out`. Returns why the daemon collects no more points; empty if it still collects.
Result<std::string> poll_points(const std::filesystem::path& socket, const json& number,
                                const char* step, VerificationFile& out, const KeepPoints& keep) {
  const auto answer = ask_daemon(
      socket,
      {{"do", "verification"}, {"step", step}, {"number", number}, {"from", out.points.size()}});
  ABBE_TRY(answer);
  for (const json& point : answer->at("points")) {
    out.points.push_back({vector_of(point.at("reading_m")), vector_of(point.at("tracker_m"))});
    print_point(out.points.size(), point);
  }
  if (!answer->at("points").empty()) ABBE_TRY(keep(out));
  return answer->value("stopped", std::string{});
}

/// The result after an error: the points collected so far, with the error as `cut_short`. If there
/// are no points, the result is the error.
Result<LivePoints> points_so_far(VerificationFile& points, const std::string& machine,
                                 const Error& error) {
  if (points.points.empty()) return tl::make_unexpected(error);
  Error cut_short{ErrorCode::Io,
                  fmt::format("after {} points: {}", points.points.size(), error.text)};
  return LivePoints{std::move(points), std::move(cut_short), machine};
}

}  // namespace

Result<LivePoints> points_of_daemon(const std::filesystem::path& socket, std::size_t count,
                                    const KeepPoints& keep, const AcceptMachine& accept) {
  const auto begun = ask_daemon(socket, {{"do", "verification"}, {"step", "begin"}});
  ABBE_TRY(begun);
  const json number = begun->at("number");
  const auto machine = begun->value("machine", std::string{});
  VerificationFile out;
  if (auto accepted = accept(machine); !accepted) {
    (void)poll_points(socket, number, "end", out, [](const auto&) { return Result<void>{}; });
    return tl::make_unexpected(accepted.error());
  }

  mark_interruptions({SIGINT, SIGTERM, SIGHUP});
  fmt::print(stderr,
             "abbe: keep the machine still for some seconds at every point; press Ctrl-C after the "
             "last one\n");
  const auto all = [&] { return interrupted() || (count != 0 && out.points.size() >= count); };

  for (; !all(); std::this_thread::sleep_for(kPointPollPeriod)) {
    const auto stopped = poll_points(socket, number, "look", out, keep);
    if (!stopped) return points_so_far(out, machine, stopped.error());
    if (stopped->empty()) continue;
    fmt::print(stderr, "abbe: {}\n", *stopped);
    break;
  }

  if (const auto ended = poll_points(socket, number, "end", out, keep); !ended)
    return points_so_far(out, machine, ended.error());
  return LivePoints{std::move(out), {}, machine};
}

}  // namespace abbe::daemon
