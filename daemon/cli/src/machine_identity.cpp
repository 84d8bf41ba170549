/// `abbe machine identity`: shows the identity of the machine, or records the decision of a person
/// after the data folder was copied or the computer replaced. Works on the file of the data folder;
/// the running daemon reads it again within two seconds.

#include "abbe/model/machine_identity.hpp"

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/json_text.hpp"
#include "abbe/base/local_time.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/config/config.hpp"
#include "abbe/result/try.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct IdentityArguments {
  std::string data_dir = "/var/lib/abbe", config, reason;
  bool json = false;
};

Result<std::filesystem::path> data_dir_of(const IdentityArguments& arguments) {
  if (arguments.config.empty()) return arguments.data_dir;
  const auto config = load_config(arguments.config);
  ABBE_TRY(config);
  return config->daemon.data_dir;
}

const char* text_of(IdentityAction action) {
  constexpr std::array kTexts{"made", "kept", "new"};
  return kTexts[static_cast<std::size_t>(action)];
}

void print_identity(const MachineIdentity& identity, const std::string& doubt) {
  fmt::print("machine_id  {}\n", identity.machine_id);
  fmt::print("state       {}\n", doubt.empty() ? "confirmed" : "not confirmed: " + doubt);
  for (const auto& e : identity.events)
    fmt::print("{:<10}  {}  {}  by {}{}\n", text_of(e.action), local_time_text(e.when),
               printable_line(e.machine_id), printable_line(e.who),
               e.why.empty() ? "" : ": " + printable_line(e.why));
}

int show_identity(const IdentityArguments& arguments) {
  const auto folder = data_dir_of(arguments);
  if (!folder) return report(folder.error());
  const auto identity = read_identity(*folder);
  if (!identity) return report(identity.error());
  if (!*identity)
    return report(
        {ErrorCode::Refused, fmt::format("{}: there is none yet; abbed makes it at its first start",
                                         identity_file(*folder).string())});
  const auto doubt = why_not_confirmed(**identity, marks_of_this_computer());
  if (arguments.json) {
    fmt::print("{}\n", indented_json_text(nlohmann::json{{"machine_id", (*identity)->machine_id},
                                                         {"confirmed", doubt.empty()},
                                                         {"reason", doubt}}));
  } else {
    print_identity(**identity, doubt);
  }
  return 0;
}

int decide(const IdentityArguments& arguments, IdentityAction action) {
  const auto folder = data_dir_of(arguments);
  if (!folder) return report(folder.error());
  const auto decided = decide_identity(
      *folder, marks_of_this_computer(),
      {.action = action, .who = user_name(), .why = arguments.reason, .when = utc_now()});
  if (!decided) return report(decided.error());
  print_identity(*decided, {});
  if (action == IdentityAction::Renewed)
    fmt::print(
        "models that were activated before are those of the other machine and stay STALE: "
        "calibrate, or activate one by name; give the new machine_id to its subscribers\n");
  return 0;
}

}  // namespace

void add_machine_identity(CLI::App& group, int& exit) {
  auto arguments = std::make_shared<IdentityArguments>();
  auto* command = group.add_subcommand(
      "identity",
      "Show the identity of the machine, beside its name; `keep` and `new` decide after\n"
      "the data folder was copied or the computer replaced");
  auto* folder =
      command->add_option("--data-dir", arguments->data_dir, "data_dir of [daemon] in abbed.toml")
          ->capture_default_str();
  command->add_option("-c,--config", arguments->config, "use the data_dir of this abbed.toml")
      ->excludes(folder);
  command->add_flag("--json", arguments->json, "print JSON");
  command->require_subcommand(0, 1);

  const auto add = [&](const char* name, const char* text, IdentityAction action) {
    auto* decision = command->add_subcommand(name, text);
    decision->fallthrough();
    decision->add_option("--reason", arguments->reason, "why; it is kept with your name")
        ->required();
    decision->callback([arguments, action, &exit] { exit = decide(*arguments, action); });
  };
  add("keep", "This is the same machine: its computer was replaced, or its disk restored",
      IdentityAction::Kept);
  add("new", "This is another machine than the one from which the data folder was copied",
      IdentityAction::Renewed);
  command->callback([arguments, command, &exit] {
    if (command->get_subcommands().empty()) exit = show_identity(*arguments);
  });
}

}  // namespace abbe::daemon
