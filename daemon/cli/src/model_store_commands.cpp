/// `abbe model list|show|add|activate|rollback|prune`: commands for the model store of a machine.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/local_time.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/calib/model/backlash.hpp"
#include "abbe/model/configuration_fit.hpp"
#include "abbe/model/stored_model.hpp"
#include "abbe/result/try.hpp"
#include "commands.hpp"
#include "force_option.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

struct ModelStoreArguments {
  StoreOption store;
  ForceOption force;
  std::string id, active;
  bool json = false, accept_older_hash = false;
  std::size_t keep_newest = 0;
  int keep_days = 0;
};

std::string state_of(const StoreEntry& entry) {
  if (!entry.fault.empty()) return "damaged";
  if (entry.active) return entry.accepted ? "active" : "active (forced)";
  if (!entry.judged) return std::string{name(VerdictState::NotJudged)};
  return entry.accepted ? "accepted" : "refused";
}

nlohmann::json simulated_json(std::optional<bool> simulated) {
  return simulated ? nlohmann::json(*simulated) : nlohmann::json();
}

nlohmann::json to_json(const StoreEntry& entry) {
  return {{"id", entry.id},           {"state", state_of(entry)},
          {"active", entry.active},   {"accepted", entry.accepted},
          {"reasons", entry.reasons}, {"added", to_text(entry.added)},
          {"method", entry.method},   {"machine", entry.machine},
          {"fault", entry.fault},     {"simulated", simulated_json(entry.simulated)}};
}

void print_table(const std::vector<StoreEntry>& entries) {
  std::size_t width = 0;  // width of the time column: local time and UTC, or UTC alone
  for (const auto& entry : entries) width = std::max(width, local_time_text(entry.added).size());
  fmt::print("{:<16}  {:<{}}  {:<6}  {:<20}  {}\n", "id", "added", width, "method", "machine",
             "state");
  for (const auto& entry : entries) {
    auto state = state_of(entry);
    if (entry.active) state = coloured(state, kGreen, STDOUT_FILENO);
    if (!entry.fault.empty())
      state = coloured(state, kRed, STDOUT_FILENO) + ": " + printable_line(entry.fault);
    fmt::print("{:<16}  {:<{}}  {:<6}  {:<20}  {}\n", entry.id, local_time_text(entry.added), width,
               entry.method, printable_line(entry.machine), state);
    if (entry.simulated.value_or(false))
      fmt::print("{:18}{}\n", "", coloured("simulated devices", kYellow, STDOUT_FILENO));
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
             local_time_text(entry.added));
  for (const auto& reason : entry.reasons) fmt::print("            {}\n", printable_line(reason));
}

void print_model(const ModelDocument& document) {
  const auto& s = document.statistics;
  fmt::print("created     {}\nmachine     {}, chain {}\nmethod      {}, {}, datum {}\n",
             local_time_text(document.created), printable_line(document.machine),
             document.model.chain().text(), document.method, document.estimator,
             name(document.model.datum()));
  fmt::print("solution    {} observations, {} unknowns, rank {}, condition {:.3g}, sigma0 {:.3f}\n",
             s.observations, s.unknowns, s.rank, s.condition, s.sigma0);
  fmt::print("residuals   {:.3f} um rms before, {:.3f} um after\n", s.before.rms_m * kUmPerM,
             s.after.rms_m * kUmPerM);
  for (const auto& input : document.inputs)
    fmt::print("input       {}  sha256 {}\n", printable_line(input.name), input.sha256);
  if (!document.recording_gap.empty())
    fmt::print("            {}\n", printable_line(cannot_be_checked(document.recording_gap)));
  fmt::print("devices     {}\n", devices_in_words(made_on_simulated_devices(document)));
  if (document.model.travel() != nullptr)
    fmt::print(
        "travel      V depends on the direction of travel (backlash {}); for one direction: abbe "
        "model eval --direction\n",
        calib::backlash_name(document.model.travel()->kind));
  fmt::print("\n{}", to_tables_csv(document.model, document.backlash, Digits::Six));
}

/// Shows a model file. It need not be in a store; without a store it is not known whether the model
/// is active.
int show_file(const ModelStoreArguments& arguments) {
  const auto document = read_model(arguments.id);
  if (!document) return report(document.error());

  if (arguments.json) {
    fmt::print("{}", to_json(*document));
  } else {
    fmt::print("id          {}\nfile        {}\nverdict     {}\n", model_id(*document),
               printable_line(arguments.id), printable_line(in_one_line(document->verdict)));
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
  const auto stored = stored_model(*store, *id);
  if (!stored) return report(stored.error());

  if (arguments.json) {
    fmt::print("{}", to_json(stored->document));
    return 0;
  }

  print_entry(stored->entry);
  if (const auto& verdict = stored->document.verdict; verdict && verdict->forced)
    fmt::print("forced by   {}\n", printable_line(who_and_when(*verdict->forced)));
  print_model(stored->document);

  return 0;
}

/// The hash of the present configuration, for which the user accepts model `id`. Refused if there
/// is nothing to accept, or if the configurations differ in keys that the version of the model
/// already knew.
Result<std::string> accepted_configuration(const ModelStoreArguments& arguments,
                                           const ModelStore& store, const std::string& id) {
  const auto config = load_config(arguments.store.config);
  ABBE_TRY(config);
  const auto document = store.load(id);
  ABBE_TRY(document);
  const auto present = present_configuration(*config);
  const auto fit = fit_of(*document, present);
  if (fit.kind == ConfigurationFit::Kind::OlderHash) return present.hash;
  return fail(
      ErrorCode::Refused,
      fmt::format("activate {}: {}", id,
                  fit.sentence.empty() ? "the model is of this configuration: activate it without "
                                         "--accept-older-hash"
                                       : fit.sentence));
}

Result<void> check_activation(const ModelStoreArguments& arguments) {
  ABBE_TRY(forced_by(arguments.force));
  if (arguments.accept_older_hash && arguments.force.why.empty())
    return fail(ErrorCode::Usage,
                "--accept-older-hash needs --why: the store keeps who accepted the model and why");
  if (arguments.accept_older_hash && arguments.store.config.empty())
    return fail(ErrorCode::Usage,
                "--accept-older-hash needs -c: the model is accepted for that configuration only");
  return {};
}

int activate(const ModelStoreArguments& arguments) {
  if (const auto valid = check_activation(arguments); !valid) return report(valid.error());
  auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const auto id = id_named(*store, arguments.id);
  if (!id) return report(id.error());
  std::string accepted;
  if (arguments.accept_older_hash) {
    auto configuration = accepted_configuration(arguments, *store, *id);
    if (!configuration) return report(configuration.error());
    accepted = *std::move(configuration);
  }
  if (const auto done =
          store->activate(*id, actor_now(arguments.force.why), arguments.force.force, accepted);
      !done)
    return report(done.error());
  fmt::print("active: {}\n", *id);
  return 0;
}

/// Refused if the model belongs to another machine than that of the configuration. Without -c the
/// machine is not known, and the check is skipped.
Result<void> check_machine(const ModelStoreArguments& arguments, const ModelDocument& document) {
  if (arguments.store.config.empty()) return {};
  const auto config = load_config(arguments.store.config);
  ABBE_TRY(config);
  const auto unfit = unfit_for(document, present_configuration(*config), "");
  if (unfit.empty()) return {};
  return fail(ErrorCode::Refused, fmt::format("add {}: {}", arguments.id, unfit));
}

Result<ModelDocument> judged_model(const std::string& file) {
  auto document = read_model(file);
  ABBE_TRY(document);
  if (!document->verdict)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: the gate has not judged this model: identify it again with this "
                            "version, or with --keep STORE",
                            file));
  return document;
}

/// Adds a model.json to the store. The model keeps the verdict of the gate in the file, also if it
/// is a refusal.
int add(const ModelStoreArguments& arguments) {
  const auto document = judged_model(arguments.id);
  if (!document) return report(document.error());
  if (const auto fits = check_machine(arguments, *document); !fits) return report(fits.error());
  auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const bool accepted = document->verdict->accepted;
  const auto id =
      store->add(*document, accepted, document->verdict->reasons, actor_now(arguments.force.why));
  if (!id) return report(id.error());

  fmt::print("added: {}\nverdict: {}\n", *id, printable_line(in_one_line(document->verdict)));
  for (const auto& input : document->inputs)
    fmt::print("input: {}  sha256 {}\n", printable_line(input.name), input.sha256);
  if (accepted) fmt::print("next: abbe model activate {}\n", *id);
  return 0;
}

int rollback(const ModelStoreArguments& arguments) {
  auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const auto active = id_named(*store, arguments.active);
  if (!active) return report(active.error());
  const auto id = store->rollback(actor_now(arguments.force.why), *active);
  if (!id) return report(id.error());
  fmt::print("active: {}\n", *id);
  return 0;
}

int prune(const ModelStoreArguments& arguments) {
  auto store = open_store(arguments.store);
  if (!store) return report(store.error());
  const ModelRetention retention{arguments.keep_newest, std::chrono::days{arguments.keep_days}};
  const auto removed = store->remove_old(retention, actor_now(arguments.force.why));
  if (!removed) return report(removed.error());
  for (const auto& id : *removed) fmt::print("removed: {}\n", id);
  fmt::print("{} models removed\n", removed->size());
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

void add_model_add(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelStoreArguments>();
  auto* command = parent.add_subcommand(
      "add",
      "Add a model of files, recordings or `abbe identify joint` to the store, with the verdict "
      "of\n"
      "the gate and the hashes of its inputs. With -c only a model of that machine. A model that\n"
      "the gate refused is added as refused");
  command->add_option("FILE", arguments->id, "model.json, as abbe identify writes it")->required();
  add_store_options(*command, arguments->store);
  command->add_option("--why,--reason", arguments->force.why, "reason, for the record");
  command->callback([arguments, &exit] { exit = add(*arguments); });
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
  add_force_options(*command, arguments->force, "activate a model that the gate refused",
                    "reason, for the record; required with --force and --accept-older-hash");
  command->add_flag("--accept-older-hash", arguments->accept_older_hash,
                    "accept a model of an earlier version for the configuration of -c: you have\n"
                    "checked that the keys its hash does not contain are as they were when it was\n"
                    "made (abbe status names them); needs -c and --why");

  command->callback([arguments, &exit] { exit = activate(*arguments); });
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
  command->add_option("--why,--reason", arguments->force.why, "reason, for the record");
  command->callback([arguments, &exit] { exit = rollback(*arguments); });
}

void add_model_prune(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelStoreArguments>();
  auto* command = parent.add_subcommand(
      "prune",
      "Remove the files of old models. The active model, those that a roll-back can activate, and "
      "the record of all models are kept");
  add_store_options(*command, arguments->store);
  command
      ->add_option("--keep-newest", arguments->keep_newest,
                   "number of models, added last, that are kept at any age")
      ->required()
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--keep-days", arguments->keep_days,
                   "models that were added less than this before now are kept, too")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--why,--reason", arguments->force.why, "reason, for the record");
  command->callback([arguments, &exit] { exit = prune(*arguments); });
}

}  // namespace abbe::daemon
