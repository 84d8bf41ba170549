/// `abbe sensors accept`: states that a sensor is correct although the daemon refuses its readings.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <string>

#include "abbe/base/control_protocol.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct AcceptArguments {
  DaemonSocket where;
  std::string sensor, why;
};

int accept_sensor(const AcceptArguments& arguments) {
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto answer = ask_daemon(*socket, {{"do", "sensors"},
                                           {"accept", true},
                                           {"sensor", arguments.sensor},
                                           {"why", arguments.why},
                                           {"who", user_name()}});
  if (!answer) return report(answer.error());
  fmt::print("{} is used when its next two readings agree; the reason is recorded\n",
             arguments.sensor);
  return 0;
}

}  // namespace

void add_sensors(CLI::App& parent, int& exit) {
  auto* group = parent.add_subcommand("sensors", "Temperature, pressure and humidity sensors");
  group->require_subcommand(1);
  auto arguments = std::make_shared<AcceptArguments>();
  auto* command = group->add_subcommand(
      "accept",
      "State that a sensor is right whose readings are refused since a jump, or because they are "
      "far\nfrom the other sensors: its history is discarded. First compare it with a thermometer. "
      "Refused while\na calibration takes readings, and for a sensor without a usable reading.");
  add_socket_options(*command, arguments->where);
  command->add_option("sensor", arguments->sensor, "name of the sensor, as in `abbe status`")
      ->required();
  command->add_option("--why,--reason", arguments->why, "reason; it is recorded with your name")
      ->required();
  command->callback([arguments, &exit] { exit = accept_sensor(*arguments); });
}

}  // namespace abbe::daemon
