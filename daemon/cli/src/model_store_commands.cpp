/// `abbe model list|show|activate|rollback`: commands for the model store of a machine.

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

struct ModelStoreArguments {
  StoreOption store;
  std::string id, why, active;
  bool json = false, force = false;
};

StoreActor actor(const ModelStoreArguments& arguments) {
  return {user_name(), arguments.why,
          std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now())};
}

std::string state_of(const StoreEntry& entry) {
  if (!entry.fault.empty()) return "damaged";
  if (entry.active) return entry.accepted ? "active" : "active (forced)";
  return entry.accepted ? "accepted" : "refused";
}

nlohmann::json to_json(const StoreEntry& entry) {
  return {{"id", entry.id},           {"state", state_of(entry)},
          {"active", entry.active},   {"accepted", entry.accepted},
          {"reasons", entry.reasons}, {"added", to_text(entry.added)},
          {"method", entry.method},   {"machine", entry.machine},
          {"fault", entry.fault}};
}

void print_table(const std::vector<StoreEntry>& entries) {
  constexpr std::size_t kSeconds = 19;  // "2024-05-17T08:30:00"
  fmt::print("{:<16}  {:<19}  {:<6}  {:<20}  {}\n", "id", "added (UTC)", "method", "machine",
             "state");
  for (const auto& entry : entries) {
    auto state = state_of(entry);
    if (entry.active) state = coloured(state, kGreen, STDOUT_FILENO);
    if (!entry.fault.empty())
      state = coloured(state, kRed, STDOUT_FILENO) + ": " + printable_line(entry.fault);
    fmt::print("{:<16}  {:<19}  {:<6}  {:<20}  {}\n", entry.id,
               to_text(entry.added).substr(0, kSeconds), entry.method,
               printable_line(entry.machine), state);
    for (const auto& reason : entry.reasons) fmt::print("{:18}{}\n", "", printable_line(reason));
  }
}

int list(const ModelStoreArguments& arguments) {
  const auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const auto entries = store->list();
  if (!entries) return report(entries.error());
  if (arguments.json) {
    nlohmann::json array = nlohmann::json::array();
    for (const auto& entry : *entries) array.push_back(to_json(entry));
    fmt::print("{}\n", indented_json_text(array));
  } else if (entries->empty()) {
    fmt::print(
        "the store has no models; `abbe calibrate` and `abbe identify ... --keep DIR` add "
        "them\n");
  } else {
    print_table(*entries);
  }
  return 0;
}

void print_entry(const StoreEntry& entry) {
  fmt::print("id          {}\nstate       {}\nadded       {}\n", entry.id, state_of(entry),
             to_text(entry.added));
  for (const auto& reason : entry.reasons) fmt::print("            {}\n", printable_line(reason));
}

void print_model(const ModelDocument& document) {
  const auto& s = document.statistics;
  fmt::print("created     {}\nmachine     {}, chain {}\nmethod      {}, {}, gauge {}\n",
             to_text(document.created), printable_line(document.machine),
             document.model.chain().text(), document.method, document.estimator,
             name(document.model.gauge()));
  fmt::print("solution    {} observations, {} unknowns, rank {}, condition {:.3g}, sigma0 {:.3f}\n",
             s.observations, s.unknowns, s.rank, s.condition, s.sigma0);
  fmt::print("residuals   {:.3f} um rms before, {:.3f} um after\n", s.before.rms_m * kUmPerM,
             s.after.rms_m * kUmPerM);
  for (const auto& input : document.inputs)
    fmt::print("input       {}  sha256 {}\n", printable_line(input.name), input.sha256);
  if (!document.recording_gap.empty())
    fmt::print("            {}\n", cannot_be_checked(document.recording_gap));
  if (document.model.travel() != nullptr)
    fmt::print(
        "travel      V depends on the direction of travel ({}): abbe model eval --direction\n",
        calib::otf::backlash_name(document.model.travel()->kind));
  fmt::print("\n{}", to_tables_csv(document.model, document.backlash));
}

Result<StoreEntry> entry_of(const ModelStore& store, const std::string& id) {
  const auto entries = store.list();
  if (!entries) return tl::make_unexpected(entries.error());
  for (const auto& entry : *entries)
    if (entry.id == id) return entry;
  return fail(ErrorCode::Usage, fmt::format("model {}: not in the store", id));
}

/// Shows a model file. It need not be in a store; without a store the state of the model and the
/// verdict of the gate are not known.
int show_file(const ModelStoreArguments& arguments) {
  const auto document = read_model(arguments.id);
  if (!document) return report(document.error());

  if (arguments.json) {
    fmt::print("{}", to_json(*document));
  } else {
    fmt::print("id          {}\nfile        {}\n", model_id(*document), arguments.id);
    print_model(*document);
  }
  return 0;
}

int show(const ModelStoreArguments& arguments) {
  const std::filesystem::path named = arguments.id;  // an id has neither folder nor extension
  if (named.has_parent_path() || named.has_extension()) return show_file(arguments);
  const auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const auto id = id_named(*store, arguments.id);
  if (!id) return report(id.error());
  const auto document = store->load(*id);
  if (!document) return report(document.error());

  if (arguments.json) {
    fmt::print("{}", to_json(*document));
    return 0;
  }

  const auto entry = entry_of(*store, *id);
  if (!entry) return report(entry.error());
  print_entry(*entry);
  print_model(*document);

  return 0;
}

int activate(const ModelStoreArguments& arguments) {
  auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const auto id = id_named(*store, arguments.id);
  if (!id) return report(id.error());
  if (const auto done = store->activate(*id, actor(arguments), arguments.force); !done)
    return report(done.error());
  fmt::print("active: {}\n", *id);
  return 0;
}

int rollback(const ModelStoreArguments& arguments) {
  auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const auto active = id_named(*store, arguments.active);
  if (!active) return report(active.error());
  const auto id = store->rollback(actor(arguments), *active);
  if (!id) return report(id.error());
  fmt::print("active: {}\n", *id);
  return 0;
}

}  // namespace

void add_model_list(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelStoreArguments>();
  auto* command = parent.add_subcommand("list", "List all models of the store, newest first");
  add_store_options(*command, arguments->store);
  command->add_flag("--json", arguments->json, "print a JSON array");
  command->callback([arguments, &exit] { exit = list(*arguments); });
}

void add_model_show(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelStoreArguments>();
  auto* command =
      parent.add_subcommand("show", "Show a model: its origin, its quality and its tables");
  command
      ->add_option("ID", arguments->id,
                   "model id, the beginning of an id (at least 4 characters), \"active\", or the "
                   "path of a model.json")
      ->required();
  add_store_options(*command, arguments->store);
  command->add_flag("--json", arguments->json, "print the whole model.json");
  command->callback([arguments, &exit] { exit = show(*arguments); });
}

void add_model_activate(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelStoreArguments>();
  auto* command =
      parent.add_subcommand("activate", "Activate a model; the store records user and reason");
  command
      ->add_option("ID", arguments->id,
                   "model id, or the beginning of an id (at least 4 characters)")
      ->required();
  add_store_options(*command, arguments->store);
  command->add_option("--why", arguments->why, "reason, for the record; required with --force");
  command->add_flag("--force", arguments->force, "activate a model that the gate refused");

  command->callback([arguments, &exit] {
    exit = arguments->force && arguments->why.empty()
               ? report({ErrorCode::Usage,
                         "--force needs --why: a forced activation is recorded with its reason"})
               : activate(*arguments);
  });
}

void add_model_rollback(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelStoreArguments>();
  auto* command = parent.add_subcommand("rollback", "Activate the previously active model again");
  arguments->active = "active";
  add_store_options(*command, arguments->store);
  command
      ->add_option("--active", arguments->active,
                   "id of the model to leave; refused if another one is active, so that a "
                   "repeated command does not go one model further back")
      ->type_name("ID");
  command->add_option("--why", arguments->why, "reason, for the record");
  command->callback([arguments, &exit] { exit = rollback(*arguments); });
}

}  // namespace abbe::daemon
