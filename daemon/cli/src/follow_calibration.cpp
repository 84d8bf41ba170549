#include "follow_calibration.hpp"

#include <fmt/format.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/refusal.hpp"
#include "abbe/base/units.hpp"
#include "follow.hpp"
#include "session_words.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

int print_session_verdict(const json& session, bool as_json) {
  const std::string state = session["state"];
  // A session never ends in "idle": the daemon has restarted.
  if (state == "idle")
    return report({ErrorCode::Io,
                   "the calibration is lost: the daemon restarted; run the command again",
                   {}});
  if (as_json) {
    fmt::print("{}\n", indented_json_text(session));
  } else {
    const std::string model = session["model_id"];
    fmt::print("calibration {}{}\n", state_in_words(session),
               model.empty() ? "" : ", model " + model);
    for (const std::string& sentence : sentences_of(session)) fmt::print("  {}\n", sentence);
  }
  return state == "active" ? 0 : exit_code(error_of_refusal(session).code);
}

/// The number and uncertainty of the tables that the run has determined so far.
struct TablesSoFar {
  std::size_t tables = 0, determined = 0;
  /// Largest standard uncertainty of the determined tables in m and in rad; empty without such a
  /// table.
  std::optional<double> u_m{}, u_rad{};
};

TablesSoFar tables_so_far(const json& live) {
  TablesSoFar found;
  for (const json& table : live.value("tables", json::array())) {
    ++found.tables;
    if (!table.value("determined", false)) continue;
    ++found.determined;
    auto& largest = table.value("unit", "") == "rad" ? found.u_rad : found.u_m;
    for (const json& u : table.value("u", json::array()))
      if (u.is_number()) largest = std::max(largest.value_or(0.0), u.get<double>());
  }

  return found;
}

/// "tables: 3 of 17 determined, largest u 0.80 um"; a unit without a determined table is left out.
std::string text_of(const TablesSoFar& so_far) {
  std::string text = fmt::format("tables: {} of {} determined", so_far.determined, so_far.tables);
  const char* separator = ", largest u ";
  if (so_far.u_m) {
    text += fmt::format("{}{:.2f} um", separator, *so_far.u_m * kUmPerM);
    separator = ", ";
  }
  if (so_far.u_rad) text += fmt::format("{}{:.2f} urad", separator, *so_far.u_rad * kUradPerRad);

  return text;
}

/// True if the largest u is less than half of the earlier one.
bool much_better(const std::optional<double>& now, const std::optional<double>& earlier) {
  constexpr double kMuchBetter = 0.5;
  return now && earlier && *now < kMuchBetter * *earlier;
}

/// The state with the remaining time: "acquiring, about 3.3 min left".
std::string with_remaining_time(const std::string& state, const json& session) {
  const std::string remaining = remaining_time(session);
  return remaining.empty() ? state : fmt::format("{}, {}", state, remaining);
}

/// Prints one line whenever state or reason of the session change, except for the verdict, for
/// example "start: waiting for the machine to stand at ...", and one line per new note. Prints the
/// tables whenever the run determines more of them than printed before. Once it determines all,
/// also whenever the largest u in um or that in urad is less than half of that printed before.
class SessionLog {
 public:
  void print_notes(ProgressBar& bar, const json& session) {
    const auto noted = session.value("noted", std::size_t{0});
    const json notes = session.value("notes", json::array());
    if (noted < noted_) noted_ = 0;  // the counter belongs to another session
    const std::size_t fresh = std::min(noted - noted_, notes.size());
    if (fresh > 0) bar.clear();
    for (std::size_t i = notes.size() - fresh; i < notes.size(); ++i)
      fmt::print(stderr, "  {}\n", notes[i].get<std::string>());
    noted_ = noted;
  }
  void print_state(ProgressBar& bar, const std::string& state, const std::string& reason) {
    std::string line = reason.empty() ? state : fmt::format("{}: {}", state, reason);
    if (line == printed_) return;
    bar.clear();
    fmt::print(stderr, "{}\n", line);
    printed_ = std::move(line);
  }

  void print_tables(ProgressBar& bar, const json& session) {
    const auto live = session.find("live");
    if (live == session.end() || !live->is_object()) return;
    const TablesSoFar now = tables_so_far(*live);
    const bool better = much_better(now.u_m, tables_.u_m) || much_better(now.u_rad, tables_.u_rad);
    if (now.determined <= tables_.determined && !(now.determined == now.tables && better)) return;
    bar.clear();
    fmt::print(stderr, "{}\n", text_of(now));
    tables_ = now;
  }

 private:
  std::string printed_;
  std::size_t noted_ = 0;
  TablesSoFar tables_;  // tables that were printed last
};

/// The session with the number `id`, running or ended; nullopt if the daemon does not keep it any
/// more. Number 0 means that an older daemon does not number sessions; its current session is
/// returned.
std::optional<json> session_in(const json& status, std::uint64_t id) {
  if (id == 0 || status["session"].value("id", std::uint64_t{0}) == id) return status["session"];
  for (const json& ended : status.value("ended_sessions", json::array()))
    if (ended.value("id", std::uint64_t{0}) == id) return ended;
  return std::nullopt;
}

int follow_session(const std::filesystem::path& socket, const std::string& method, std::uint64_t id,
                   bool as_json) {
  ProgressBar bar;
  SessionLog log;
  const auto look = [&](const json& status) -> std::optional<int> {
    const auto found = session_in(status, id);
    if (!found) {
      bar.clear();
      return report(
          {ErrorCode::Io, fmt::format("calibration {} has ended, but the daemon has discarded its "
                                      "verdict, because later calibrations have ended since: `abbe "
                                      "model list` shows its model, if it gave one",
                                      id)});
    }

    const json& session = *found;
    const std::string state = session["state"];
    log.print_notes(bar, session);
    if (state == "active" || state == "refused" || state == "idle") {
      bar.clear();
      return print_session_verdict(session, as_json);
    }
    log.print_state(
        bar, state_in_words(session),
        session.contains("verdict") ? std::string{} : session["reason"].get<std::string>());
    log.print_tables(bar, session);
    bar.show(with_remaining_time(state_in_words(session), session),
             session["progress"].get<double>());
    return std::nullopt;
  };

  return follow({.socket = socket,
                 .what = "the calibration",
                 .cancel = fmt::format("abbe calibrate {} --cancel", method),
                 .look = look},
                bar);
}

}  // namespace

void add_follow_options(CLI::App& command, FollowOptions& options, CLI::Option* excluded) {
  add_socket_options(command, options.where);
  command.add_flag("--detach", options.detach,
                   "return as soon as the daemon has begun the calibration");
  command.add_flag("--cancel", options.cancel, "end the running calibration")->excludes(excluded);
  command.add_flag("--json", options.json, "print the verdict as JSON");
}

int cancel_calibration(const FollowOptions& options) {
  const auto socket = socket_path(options.where);
  if (!socket) return report(socket.error());
  const auto answer = ask_daemon(*socket, {{"do", "cancel"}, {"who", user_name()}});
  return answer ? 0 : report(answer.error());
}

int run_calibration(const FollowOptions& options, json task) {
  const auto socket = socket_path(options.where);
  if (!socket) return report(socket.error());
  const auto method = task.at("method").get<std::string>();
  task["do"] = "calibrate";
  task["who"] = user_name();
  const auto started = ask_daemon(*socket, task);
  if (!started) return report(started.error());
  const auto id = started->value("session", std::uint64_t{0});
  return options.detach ? 0 : follow_session(*socket, method, id, options.json);
}

}  // namespace abbe::daemon
