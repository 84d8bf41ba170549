/// `abbe tracker`: commands for the laser tracker of the running daemon.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/json_text.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "follow.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

struct TrackerArguments {
  DaemonSocket where;
  double distance_m = 0.0;
  std::string reflector;
  bool json = false;
};

std::string text_at(const json& object, const char* member) {
  return object.at(member).get<std::string>();
}

void print_reflectors(const json& order) {
  for (const json& r : order.value("reflectors", json::array()))
    fmt::print("{:>4}  {:<32}{}\n", r["id"].get<std::int32_t>(), text_at(r, "name"),
               r["in_use"].get<bool>() ? "  in use" : "");
}

/// Prints the outcome of an order that has ended; returns the exit code.
int print_outcome(const json& order, bool as_json) {
  const std::string outcome = text_at(order, "outcome");
  if (outcome != "done")
    return report(
        {outcome == "refused" ? ErrorCode::Refused : ErrorCode::Io,
         fmt::format("tracker: {}: {}", text_at(order, "order"), text_at(order, "text"))});
  if (as_json) {
    fmt::print("{}\n", indented_json_text(order));
  } else {
    fmt::print("{}\n", text_at(order, "text"));
    print_reflectors(order);
  }
  return 0;
}

/// Sends the order to the daemon and waits until the daemon reports its outcome.
int give_order(const TrackerArguments& arguments, const json& request) {
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto given = ask_daemon(*socket, request);
  if (!given) return report(given.error());
  const json number = given->at("order");  // identifies the order in the status

  const auto look = [&](const json& status) -> std::optional<int> {
    for (const json& order :
         status.value("tracker", json::object()).value("orders", json::array())) {
      if (order.at("number") != number) continue;
      if (text_at(order, "outcome") == "running") return std::nullopt;
      return print_outcome(order, arguments.json);
    }
    return report(
        {ErrorCode::Io,
         fmt::format("tracker: the outcome of order {} is lost: the daemon keeps only the latest "
                     "orders; see `abbe tracker status`",
                     json_text(number))});
  };

  ProgressBar no_bar{false};
  return follow({.socket = *socket, .what = "the order to the tracker", .cancel = "", .look = look},
                no_bar);
}

int initialize_tracker(const TrackerArguments& arguments) {
  return give_order(arguments, {{"do", "tracker"}, {"order", "initialize"}});
}

int send_tracker_home(const TrackerArguments& arguments) {
  return give_order(arguments, {{"do", "tracker"}, {"order", "home"}});
}

int find_reflector(const TrackerArguments& arguments) {
  return give_order(arguments,
                    {{"do", "tracker"}, {"order", "find"}, {"distance_m", arguments.distance_m}});
}

int set_reflector(const TrackerArguments& arguments) {
  return give_order(
      arguments,
      {{"do", "tracker"}, {"order", "reflector set"}, {"reflector", arguments.reflector}});
}

int list_reflectors(const TrackerArguments& arguments) {
  return give_order(arguments, {{"do", "tracker_reflectors"}});
}

void print_tracker(const json& tracker) {
  const bool connected = tracker["connected"];
  fmt::print("{}    {}\n", text_at(tracker, "name"),
             coloured(text_at(tracker, "state"), connected ? kGreen : kYellow, STDOUT_FILENO));
  if (const std::string fault = text_at(tracker, "last_fault"); !fault.empty())
    fmt::print("last fault {}\n", fault);
  for (const json& order : tracker["orders"]) {
    fmt::print("order {:<4} {} of {}: {}{}{}\n", order["number"].get<std::uint64_t>(),
               text_at(order, "order"), text_at(order, "by"), text_at(order, "outcome"),
               text_at(order, "text").empty() ? "" : ": ", text_at(order, "text"));
  }
}

int show_tracker(const TrackerArguments& arguments) {
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto status = ask_daemon(*socket, {{"do", "status"}});
  if (!status) return report(status.error());
  if (!status->contains("tracker"))
    return report({ErrorCode::Refused,
                   "tracker: the daemon's configuration has no tracker: set [tracker] host"});

  if (arguments.json) {
    fmt::print("{}\n", indented_json_text(status->at("tracker")));
  } else {
    print_tracker(status->at("tracker"));
  }

  return 0;
}

}  // namespace

void add_tracker(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<TrackerArguments>();
  auto* group =
      parent.add_subcommand("tracker",
                            "Control the laser tracker of the running daemon. An order stops the "
                            "measurement, waits for the answer of\n"
                            "the tracker and starts the measurement again. Orders are refused "
                            "while a calibration takes readings.\n"
                            "Exit code 5: refused; 4: no answer.");
  group->require_subcommand(1);

  const auto add = [&](CLI::App& to, const char* name, const char* text,
                       int (*run)(const TrackerArguments&)) {
    auto* command = to.add_subcommand(name, text);
    add_socket_options(*command, arguments->where);
    command->add_flag("--json", arguments->json, "print one JSON object");
    command->callback([arguments, run, &exit] { exit = run(*arguments); });
    return command;
  };

  add(*group, "status", "Show its state, the reason if no points arrive, and the latest orders",
      show_tracker);
  add(*group, "initialize",
      "Initialize the tracker: the head rotates and the beam leaves the reflector. Then the beam\n"
      "goes to the bird bath, if [tracker] home_after_initialize = true",
      initialize_tracker);
  add(*group, "home", "Point the beam at the bird bath (GoBirdBath)", send_tracker_home);
  add(*group, "find", "Search for a reflector near the direction of the beam (FindReflector)",
      find_reflector)
      ->add_option("--distance-m", arguments->distance_m,
                   "approximate distance of the reflector, m; at most 200")
      ->required();
  auto* reflector =
      group->add_subcommand("reflector", "List or set the reflectors defined in the controller");
  reflector->require_subcommand(1);
  add(*reflector, "list", "List id and name of each reflector, and the one in use",
      list_reflectors);
  add(*reflector, "set",
      "Measure to another reflector. The setting stays until it is changed; abbed sets only\n"
      "[tracker] reflector again when it starts",
      set_reflector)
      ->add_option("reflector", arguments->reflector, "name or id of the reflector")
      ->required();
}

}  // namespace abbe::daemon
