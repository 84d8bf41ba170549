/// `abbe status`: shows model, session, devices and DDS state of the running daemon.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/units.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "session_words.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

int colour_of_model(const std::string& state) {
  if (state == "ACTIVE") return kGreen;
  return state == "INVALID" ? kRed : kYellow;
}

void print_stream(const json& s) {
  const bool connected = s["connected"];
  fmt::print("{:<10} {:<14} {:>8.1f}/s {:>10} {:>7} {:>5} {:>7}  {}\n",
             s["name"].get<std::string>(),
             coloured(fmt::format("{:<14}", s["state"].get<std::string>()),
                      connected ? kGreen : kYellow, STDOUT_FILENO),
             s["rate_hz"].get<double>(), s["samples"].get<std::uint64_t>(),
             s["dropped"].get<std::uint64_t>(), s["gaps"].get<std::uint64_t>(),
             s.contains("faults") ? s["faults"].get<std::uint64_t>() : 0,
             s["last_fault"].get<std::string>());
  if (const auto condition = s.value("condition", std::string{}); !condition.empty())
    fmt::print("           {}\n", coloured(condition, kYellow, STDOUT_FILENO));
}

std::string value_text(const json& value, int digits, std::string_view unit) {
  return value.is_number() ? fmt::format("{:.{}f} {}", value.get<double>(), digits, unit)
                           : fmt::format("- {}", unit);
}

void print_environment(const json& e) {
  fmt::print("air        {}, {}, {}", value_text(e["air_temperature_C"], 2, "C"),
             value_text(e["air_pressure_hPa"], 2, "hPa"),
             value_text(e["relative_humidity_percent"], 1, "%"));
  if (e.contains("refractive_index")) {
    const json& index = e["refractive_index"];
    fmt::print(", n = {:.9f} (u = {:.1e})", index["n"].get<double>(), index["u_n"].get<double>());
  }
  fmt::print("\n");
  for (const auto& [name, value] : e["temperatures_C"].items())
    fmt::print("           {} {}\n", name, value_text(value, 2, "C"));
}

void print_reference(const json& reference) {
  fmt::print("reference  {}", reference["running"].get<bool>() ? "searching for marks; " : "");
  for (const json& axis : reference["axes"])
    fmt::print("{} {}", axis["axis"].get<std::string>(),
               axis["known"].get<bool>() ? "referenced " : "not referenced ");
  fmt::print("\n");
}

/// Text for the position of an axis, in mm or degrees; "-" for an axis without a current position.
std::string position_text(const json& axis, const json& position) {
  constexpr double kDegreesPerRad = 180.0 / std::numbers::pi;
  const bool rotary = axis["kind"] == "rotary";
  if (!position.is_number()) return fmt::format("{} -", axis["axis"].get<std::string>());
  return fmt::format("{} {:.4f} {}", axis["axis"].get<std::string>(),
                     position.get<double>() * (rotary ? kDegreesPerRad : kMmPerM),
                     rotary ? "deg" : "mm");
}

/// Prints the axis positions. Older versions of abbed send no "axes"; nothing is printed then.
void print_positions(const json& status) {
  const json axes = status.value("axes", json::array());
  const json positions = status.value("position_m", json::array());
  if (axes.empty() || axes.size() != positions.size()) return;

  fmt::print("position   ");
  for (std::size_t i = 0; i < axes.size(); ++i)
    fmt::print("{}{}", i == 0 ? "" : "  ", position_text(axes[i], positions[i]));
  fmt::print("\n");
  for (const json& axis : axes)
    if (const auto missing = axis.value("missing", std::string{}); !missing.empty())
      fmt::print("           {}: {}\n", axis["axis"].get<std::string>(),
                 coloured(missing, kYellow, STDOUT_FILENO));
}

/// Prints the identity of the machine. Earlier versions of abbed send none; nothing is printed
/// then.
void print_identity(const json& identity) {
  if (identity.empty()) return;
  const auto id = identity.value("machine_id", std::string{});
  fmt::print("identity   {}{}\n", id.empty() ? "-" : id,
             identity.value("confirmed", false) ? "" : "  not confirmed");
  const auto show = [](const std::string& text) {
    if (!text.empty()) fmt::print("           {}\n", coloured(text, kYellow, STDOUT_FILENO));
  };
  show(identity.value("reason", std::string{}));
  if (const auto twin = identity.value("twin", std::string{}); !twin.empty())
    show("another machine publishes with " + twin);
}

void print_next(const json& next) {
  const std::string of = next.contains("measurement")
                             ? fmt::format("measurement {}", next["measurement"].get<std::string>())
                             : fmt::format("position {}", next["position"].get<int>());
  fmt::print("next       {} of {}, {} of {} points touched\n", next["on"].get<std::string>(), of,
             next["touched"].get<std::size_t>(), next["points"].get<std::size_t>());
}

/// Prints for each condition of the start whether it holds.
void print_start(const json& start) {
  for (const json& condition : start["conditions"]) {
    const bool met = condition["met"];
    fmt::print("           {} {}\n",
               coloured(met ? "yes" : "NO ", met ? kGreen : kRed, STDOUT_FILENO),
               condition["text"].get<std::string>());
  }
}

/// The text of a table: "EXX  12.3 um at 150 mm (u 0.4)" or "EXX  not yet determined (4 of 13
/// nodes)".
std::string live_table_text(const json& table) {
  const json &value = table["value"], &u = table["u"];
  const std::string name = table["table"];
  const auto count = static_cast<std::size_t>(
      std::ranges::count_if(value, [](const json& each) { return each.is_number(); }));
  if (!table["determined"].get<bool>())
    return fmt::format(
        "{}  not yet determined{}", name,
        value.size() > 1 ? fmt::format(" ({} of {} nodes)", count, value.size()) : std::string{});

  std::size_t largest = 0;
  double largest_u = 0.0;
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (std::abs(value[i].get<double>()) > std::abs(value[largest].get<double>())) largest = i;
    largest_u = std::max(largest_u, u[i].get<double>());
  }
  return fmt::format(
      "{}  {:.2f} {}{}, u {:.2f}, largest u {:.2f}", name, value[largest].get<double>() * kUmPerM,
      table["unit"] == "rad" ? "urad" : "um",
      table.contains("at_m")
          ? fmt::format(" at {:.0f} mm", table["at_m"][largest].get<double>() * kMmPerM)
          : "",
      u[largest].get<double>() * kUmPerM, largest_u * kUmPerM);
}

void print_live(const json& live) {
  fmt::print("tables     of {} points so far: largest value of each and its standard uncertainty\n",
             live["samples"].get<std::size_t>());
  for (const json& table : live["tables"]) fmt::print("           {}\n", live_table_text(table));
}

void print_release_awaited(const json& awaited) {
  fmt::print(
      "{}    {}\n           the machine does not move before a person has checked it and run: {}\n",
      coloured("RELEASE", kRed, STDOUT_FILENO), awaited["reason"].get<std::string>(),
      awaited["command"].get<std::string>());
}

void print_machine_stop(const json& stop) {
  const auto outcome = stop["outcome"].get<std::string>();
  fmt::print("stop       {}: {}\n",
             outcome == "stopped" ? outcome : coloured(outcome, kRed, STDOUT_FILENO),
             stop["text"].get<std::string>());
}

void print_dds(const json& dds) {
  const bool connected = dds["connected"].get<bool>();
  const auto state = dds.value("state", std::string{});  // older versions of abbed do not send it
  fmt::print("dds        {}, {} messages",
             connected                    ? "connected"
             : state == "does not answer" ? "abbe-dds does not answer"
                                          : "not connected",
             dds["sent"].get<std::uint64_t>());

  if (const auto restarts = dds.value("restarts", std::uint64_t{0}); restarts > 0)
    fmt::print(", abbe-dds restarted {} times", restarts);
  fmt::print("\n");
  if (dds.contains("last_end"))
    fmt::print("           last end: {}\n", dds["last_end"].get<std::string>());
  if (const auto refused = dds.value("refused_connections", std::uint64_t{0}); refused > 0)
    fmt::print("           {} connections of other processes to its socket were refused\n",
               refused);
  const auto security = dds.value("security", std::string{"on"});
  fmt::print("           {}\n", security == "on" ? "DDS Security is on" : security);
}

/// Text that names the simulated parts; empty if neither the devices nor the active model are
/// simulated. Older versions of abbed do not send this.
std::string simulated_parts(const json& status) {
  const bool devices = status.value("simulated", false);
  const bool model = status["model"].value("simulated", false);
  if (devices && model) return "SIMULATED devices; the model was made on simulated devices";
  if (devices) return "SIMULATED devices";
  return model ? "the model was made on SIMULATED devices" : "";
}

/// Prints the name of the recording file and the delay of the recording.
void print_recording(const json& status) {
  fmt::print("recording  {}", status["recording"].get<std::string>());
  for (const json& stream : status["streams"])
    if (stream.contains("behind_s"))
      fmt::print(", {:.1f} s behind", stream["behind_s"].get<double>());
  fmt::print("\n");
}

void print_status(const json& status) {
  const json& model = status["model"];
  const std::string state = model["state"];
  fmt::print("machine    {}\n", status["machine"].get<std::string>());
  print_identity(status.value("identity", json::object()));
  if (const auto simulated = simulated_parts(status); !simulated.empty())
    fmt::print("           {}\n", coloured(simulated, kYellow, STDOUT_FILENO));
  fmt::print("model      {} {} ({})\n", coloured(state, colour_of_model(state), STDOUT_FILENO),
             model.value("id", "-"), model["reason"].get<std::string>());
  for (const json& change : status.value("clock", json::array()))
    fmt::print("clock      {}\n", coloured(change.get<std::string>(), kYellow, STDOUT_FILENO));
  if (status.contains("release_awaited")) print_release_awaited(status["release_awaited"]);
  if (status.contains("machine_stop")) print_machine_stop(status["machine_stop"]);
  const json& session = status["session"];
  fmt::print("session    {}", state_in_words(session));
  if (session["points"].get<std::uint64_t>() > 0)
    fmt::print(", {:.0f} %, {} points", 100.0 * session["progress"].get<double>(),
               session["points"].get<std::uint64_t>());
  fmt::print("\n");
  for (const std::string& sentence : sentences_of(session)) fmt::print("           {}\n", sentence);
  if (const auto remaining = remaining_time(session); !remaining.empty())
    fmt::print("           {}\n", remaining);
  if (session.contains("start")) print_start(session["start"]);
  if (session.contains("next")) print_next(session["next"]);
  if (session.contains("live")) print_live(session["live"]);
  for (const json& note : session["notes"]) fmt::print("           {}\n", note.get<std::string>());
  print_positions(status);
  if (status.contains("reference")) print_reference(status["reference"]);

  if (const json axes = status.value("axes_without_zero", json::array()); !axes.empty()) {
    fmt::print("axes      ");
    for (const json& axis : axes) fmt::print(" {}", axis.get<std::string>());
    fmt::print(
        " not referenced: move them to where they read their offset, then run `abbe reference "
        "--here`\n");
  }

  if (status.contains("environment")) print_environment(status["environment"]);
  if (status.contains("unmeasured_air"))
    fmt::print("tracker    {}\n",
               coloured(status["unmeasured_air"].get<std::string>(), kYellow, STDOUT_FILENO));
  if (status.contains("recording")) print_recording(status);
  if (status.contains("dds")) print_dds(status["dds"]);
  fmt::print("\n{:<10} {:<14} {:>10} {:>10} {:>7} {:>5} {:>7}  {}\n", "stream", "state", "rate",
             "samples", "dropped", "gaps", "faults", "last fault");
  for (const json& stream : status["streams"]) print_stream(stream);
}

int status(const DaemonSocket& where, bool as_json) {
  const auto socket = socket_path(where);
  if (!socket) return report(socket.error());
  const auto answer = ask_daemon(*socket, {{"do", "status"}});
  if (!answer) return report(answer.error());
  if (as_json) {
    fmt::print("{}\n", answer->dump(1));
  } else {
    print_status(*answer);
  }
  return 0;
}

}  // namespace

void add_status(CLI::App& parent, int& exit) {
  auto where = std::make_shared<DaemonSocket>();
  auto as_json = std::make_shared<bool>(false);
  auto* command = parent.add_subcommand(
      "status", "Show model, session, devices and DDS state of the running daemon");
  add_socket_options(*command, *where);
  command->add_flag("--json", *as_json, "print one JSON object");
  command->callback([where, as_json, &exit] { exit = status(*where, *as_json); });
}

}  // namespace abbe::daemon
