/// `abbe tracker`: what a person does with the laser tracker of the running daemon.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/control_protocol.hpp"
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

/// What came of an order that has ended; returns the exit code.
int print_outcome(const json& order, bool as_json) {
  const std::string outcome = text_at(order, "outcome");
  if (outcome != "done")
    return report(
        {outcome == "refused" ? ErrorCode::Refused : ErrorCode::Io,
         fmt::format("tracker: {}: {}", text_at(order, "order"), text_at(order, "text"))});
  if (as_json) {
    fmt::print("{}\n", order.dump(1));
  } else {
    fmt::print("{}\n", text_at(order, "text"));
    print_reflectors(order);
  }
  return 0;
}

/// Waits until the daemon reports the order, which its answer numbers.
int give_order(const TrackerArguments& arguments, const json& request) {
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto given = ask_daemon(*socket, request);
  if (!given) return report(given.error());
  const json number = given->at("order");

  const auto look = [&](const json& status) -> std::optional<int> {
    for (const json& order :
         status.value("tracker", json::object()).value("orders", json::array())) {
      if (order.at("number") != number) continue;
      if (text_at(order, "outcome") == "running") return std::nullopt;
      return print_outcome(order, arguments.json);
    }
    return report(
        {ErrorCode::Io,
         fmt::format("tracker: order {} is too old: what came of it is not kept", number.dump())});
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
                   "tracker: there is no tracker, [tracker] host, in the daemon's configuration"});

  if (arguments.json) {
    fmt::print("{}\n", status->at("tracker").dump(1));
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
                            "The laser tracker of the running daemon. Orders stop the measurement, "
                            "wait for the tracker's answer and "
                            "start\n"
                            "the measurement again. They are refused while a calibration takes "
                            "readings. Exit code 5: refused, 4: no "
                            "answer.");
  group->require_subcommand(1);

  const auto add = [&](CLI::App& to, const char* name, const char* text,
                       int (*run)(const TrackerArguments&)) {
    auto* command = to.add_subcommand(name, text);
    add_socket_options(*command, arguments->where);
    command->add_flag("--json", arguments->json, "as one JSON object");
    command->callback([arguments, run, &exit] { exit = run(*arguments); });
    return command;
  };

  add(*group, "status", "Its state, why no points come, and the latest orders", show_tracker);
  add(*group, "initialize",
      "Initialize the tracker: the head turns and the beam is dropped. To the bird bath after it, "
      "if "
      "[tracker]\n"
      "home_after_initialize = true",
      initialize_tracker);
  add(*group, "home", "The beam to the bird bath (GoBirdBath)", send_tracker_home);
  add(*group, "find", "Search for a reflector around where the beam points (FindReflector)",
      find_reflector)
      ->add_option("--distance-m", arguments->distance_m,
                   "about how far away the reflector is, m; at most 200")
      ->required();
  auto* reflector = group->add_subcommand("reflector", "The reflectors that the controller knows");
  reflector->require_subcommand(1);
  add(*reflector, "list", "Id and name of each, and which one is in use", list_reflectors);
  add(*reflector, "set",
      "Measure to another reflector. It stays set; only [tracker] reflector is set again when "
      "abbed starts",
      set_reflector)
      ->add_option("reflector", arguments->reflector, "its name or id")
      ->required();
}

}  // namespace abbe::daemon
