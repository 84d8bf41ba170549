#include "abbe/model/machine_identity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <cctype>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::string_view kIdentitySchema = "abbe/identity/1";
constexpr std::array<std::string_view, 3> kIdentityActions{"made", "kept", "renewed"};
constexpr std::size_t kUuidLength = 36;

std::string first_word_of(const fs::path& file) {
  std::string word;
  if (std::ifstream stream{file}; stream >> word) return word;
  return {};
}

/// The mark of a text: 128 bits of a hash, which is enough to distinguish computers.
std::string mark_of(std::string_view what, const std::string& text) {
  return sha256_hex(fmt::format("abbe computer {}: {}", what, text)).substr(0, 32);
}

/// True if the manufacturer of the card gave `address`, "52:54:00:12:34:56". Other addresses are
/// random or set by software.
bool is_permanent(const std::string& address) {
  if (address.size() != 17) return false;
  const auto digits = std::string_view{"0123456789abcdef"};
  const auto low = digits.find(address[1]);
  const bool zero = address.find_first_not_of("0:") == std::string::npos;
  return low != std::string_view::npos && (low & 2u) == 0 && !zero;
}

/// True for a network card of the computer: the interface has a device, and the device is not
/// plugged into USB.
bool is_built_in(const fs::path& interface) {
  std::error_code none;
  if (!fs::exists(interface / "device", none)) return false;
  return fs::read_symlink(interface / "device" / "subsystem", none).filename() != "usb";
}

/// A random UUID from getrandom(2), because abbed.service hides /proc/sys, where the kernel offers
/// one. Empty: the kernel gives no random numbers.
std::string random_uuid() {
  try {
    return boost::uuids::to_string(boost::uuids::random_generator_pure{}());
  } catch (const boost::uuids::entropy_error&) {
    return {};
  }
}

bool is_uuid(const std::string& text) {
  if (text.size() != kUuidLength) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool dash = i == 8 || i == 13 || i == 18 || i == 23;
    if (dash ? text[i] != '-' : std::isxdigit(static_cast<unsigned char>(text[i])) == 0)
      return false;
  }
  return true;
}

json identity_event_json(const IdentityEvent& e) {
  json event{{"action", kIdentityActions[static_cast<std::size_t>(e.action)]},
             {"machine_id", e.machine_id},
             {"who", e.who},
             {"why", e.why},
             {"when", to_text(e.when)}};
  if (e.store) event["store"] = {{"events", e.store->events}, {"last", e.store->last}};
  return event;
}

json identity_json(const MachineIdentity& identity) {
  json events = json::array();
  for (const auto& e : identity.events) events.push_back(identity_event_json(e));
  return {{"schema", kIdentitySchema},
          {"machine_id", identity.machine_id},
          {"computer",
           {{"machine_id", identity.computer.machine_id},
            {"interfaces", identity.computer.interfaces}}},
          {"events", std::move(events)}};
}

/// The place in the event; nullopt: it has none. Throws json::exception as below.
std::optional<StorePlace> store_place_from(const json& event) {
  if (!event.contains("store")) return std::nullopt;
  const json& place = event.at("store");
  return StorePlace{place.at("events").get<std::size_t>(), place.at("last").get<std::string>()};
}

/// The event in a JSON object; nullopt: its action is not known. Throws json::exception if a member
/// is missing or has the wrong type.
std::optional<IdentityEvent> identity_event_from(const json& object) {
  const auto action = std::ranges::find(kIdentityActions, object.at("action").get<std::string>());
  const auto when = utc_from_text(object.at("when").get<std::string>());
  if (action == kIdentityActions.end() || !when) return std::nullopt;
  return IdentityEvent{.action = static_cast<IdentityAction>(action - kIdentityActions.begin()),
                       .machine_id = object.at("machine_id").get<std::string>(),
                       .who = object.at("who").get<std::string>(),
                       .why = object.at("why").get<std::string>(),
                       .when = *when,
                       .store = store_place_from(object)};
}

/// The identity in the document; nullopt: a value cannot be used. Throws json::exception as above.
std::optional<MachineIdentity> identity_from(const json& document) {
  if (document.at("schema").get<std::string>() != kIdentitySchema) return std::nullopt;
  const json& computer = document.at("computer");
  MachineIdentity identity{
      .machine_id = document.at("machine_id").get<std::string>(),
      .computer = {.machine_id = computer.at("machine_id").get<std::string>(),
                   .interfaces = computer.at("interfaces").get<std::vector<std::string>>()},
      .events = {}};
  for (const json& object : document.at("events")) {
    auto event = identity_event_from(object);
    if (!event) return std::nullopt;
    identity.events.push_back(std::move(*event));
  }
  if (!is_uuid(identity.machine_id)) return std::nullopt;
  return identity;
}

Result<void> write_identity(const fs::path& data_dir, const MachineIdentity& identity) {
  ABBE_TRY(create_folder(data_dir));
  return replace_file(identity_file(data_dir), indented_json_text(identity_json(identity)) + "\n");
}

std::string store_event_text(const StoreEvent& event) {
  return fmt::format("{} {}", event.id, to_text(event.actor.when));
}

/// True if the events before `place` are those of `history`.
bool is_place_of(const StorePlace& place, std::span<const StoreEvent> history) {
  if (place.events > history.size()) return false;
  return place.events == 0 || store_event_text(history[place.events - 1]) == place.last;
}

/// True if event `i` of the store is later than `decision`.
bool is_later(std::span<const StoreEvent> history, std::size_t i, const IdentityEvent& decision) {
  if (decision.store && is_place_of(*decision.store, history)) return i >= decision.store->events;
  return history[i].actor.when >= decision.when;
}

/// The end of the store's list of events. A store that does not exist yet has no events.
std::optional<StorePlace> end_of_store(const fs::path& data_dir) {
  const auto history = ModelStore{data_dir / "models"}.history();
  if (!history) return std::nullopt;
  return end_of(*history);
}

Result<MachineIdentity> new_identity(const ComputerMarks& here, std::vector<IdentityEvent> events,
                                     IdentityEvent event) {
  event.machine_id = random_uuid();
  if (!is_uuid(event.machine_id))
    return fail(ErrorCode::Io, "no identity can be made: the kernel gives no random numbers");
  MachineIdentity identity{
      .machine_id = event.machine_id, .computer = here, .events = std::move(events)};
  identity.events.push_back(std::move(event));
  return identity;
}

}  // namespace

ComputerMarks marks_of_this_computer(const fs::path& root) {
  ComputerMarks marks;
  if (const auto id = first_word_of(root / "etc/machine-id"); !id.empty() && id != "uninitialized")
    marks.machine_id = mark_of("machine-id", id);

  std::error_code none;
  for (fs::directory_iterator each(root / "sys/class/net", none), end; !none && each != end;
       each.increment(none)) {
    const auto address = first_word_of(each->path() / "address");
    if (is_permanent(address) && is_built_in(each->path()))
      marks.interfaces.push_back(mark_of("interface", address));
  }

  std::ranges::sort(marks.interfaces);
  return marks;
}

bool same_computer(const ComputerMarks& a, const ComputerMarks& b) noexcept {
  if (!a.machine_id.empty() && !b.machine_id.empty() && a.machine_id != b.machine_id) return false;
  if (a.interfaces.empty() || b.interfaces.empty()) return true;
  return std::ranges::find_first_of(a.interfaces, b.interfaces) != a.interfaces.end();
}

StorePlace end_of(std::span<const StoreEvent> history) {
  return {history.size(), history.empty() ? std::string{} : store_event_text(history.back())};
}

const IdentityEvent* MachineIdentity::renewal() const noexcept {
  const IdentityEvent* last = nullptr;
  for (const auto& event : events)
    if (event.action == IdentityAction::Renewed) last = &event;
  return last;
}

std::string MachineIdentity::machine_id_at(protocol::UtcTime time) const {
  if (events.empty()) return machine_id;
  std::string then = events.front().machine_id;
  for (const auto& event : events)
    if (event.when <= time) then = event.machine_id;
  return then;
}

std::vector<std::string> models_of_other_machine(const MachineIdentity& identity,
                                                 std::span<const StoreEvent> history) {
  const IdentityEvent* renewal = identity.renewal();
  if (renewal == nullptr) return {};
  std::map<std::string, bool> own;
  for (std::size_t i = 0; i < history.size(); ++i) {
    const auto& id = history[i].id;
    const auto action = history[i].action;
    if (action == StoreAction::Activated || action == StoreAction::Forced)
      own[id] = is_later(history, i, *renewal);
    else if (action == StoreAction::Added)
      own.try_emplace(id, is_later(history, i, *renewal));
  }

  std::vector<std::string> others;
  for (const auto& [id, is_own] : own)
    if (!is_own) others.push_back(id);
  return others;
}

std::optional<std::string> machine_id_of_model(const MachineIdentity& identity,
                                               std::span<const StoreEvent> history,
                                               const std::string& id) {
  const auto added = std::ranges::find_if(history, [&id](const StoreEvent& event) {
    return event.id == id && event.action == StoreAction::Added;
  });
  if (added == history.end() || identity.events.empty()) return std::nullopt;
  const auto i = static_cast<std::size_t>(added - history.begin());
  std::string then = identity.events.front().machine_id;
  for (const auto& event : identity.events)
    if (event.action == IdentityAction::Renewed && is_later(history, i, event))
      then = event.machine_id;
  return then;
}

fs::path identity_file(const fs::path& data_dir) {
  return data_dir / "identity.json";
}

Result<std::optional<MachineIdentity>> read_identity(const fs::path& data_dir) {
  const fs::path file = identity_file(data_dir);
  std::error_code seen;
  if (!fs::exists(file, seen) && (!seen || seen == std::errc::no_such_file_or_directory))
    return std::optional<MachineIdentity>{};
  const auto text = read_regular_file(file);
  ABBE_TRY(text);
  const auto document = parse_json(*text, file.string(), {.bytes = 1u << 20});
  ABBE_TRY(document);

  const auto damaged = [&file](const std::string& why) {
    return fail(ErrorCode::BadInput,
                fmt::format("{}: {}; restore it, or make a new identity with `abbe machine "
                            "identity new --reason ...`",
                            file.string(), why));
  };

  try {
    auto identity = identity_from(*document);
    if (!identity) return damaged("is not an identity of a machine");
    return identity;
  } catch (const json::exception& error) {
    return damaged(cause_of(error));
  }
}

Result<MachineIdentity> open_identity(const fs::path& data_dir, const ComputerMarks& here,
                                      protocol::UtcTime now) {
  auto known = read_identity(data_dir);
  ABBE_TRY(known);
  if (*known) return std::move(**known);
  auto made =
      new_identity(here, {}, {.machine_id = {}, .who = "abbed", .why = "first start", .when = now});
  if (!made) return made;
  ABBE_TRY(write_identity(data_dir, *made));
  return made;
}

std::string why_not_confirmed(const MachineIdentity& identity, const ComputerMarks& here) {
  if (same_computer(identity.computer, here)) return {};
  return fmt::format(
      "identity {} belongs to another computer: the data folder or the disk was copied, or the "
      "computer replaced; run `abbe machine identity keep --reason ...` if this is the same "
      "machine, `abbe machine identity new --reason ...` if it is another one",
      identity.machine_id);
}

Result<std::optional<MachineIdentity>> identity_of(const ModelStore& store) {
  std::error_code none;
  const auto models = fs::absolute(store.model_path({}), none).lexically_normal().parent_path();
  return read_identity(models.parent_path().parent_path());
}

std::string identity_doubt(const ModelStore& store, const std::string& id,
                           const ComputerMarks& here) {
  const auto identity = identity_of(store);
  // A damaged file is reported, because it may hide that a person still has to decide.
  if (!identity) return identity.error().code == ErrorCode::BadInput ? identity.error().text : "";
  if (!*identity) return {};
  if (auto why = why_not_confirmed(**identity, here); !why.empty()) return why;
  const auto history = store.history();
  if (!history) return {};
  const auto others = models_of_other_machine(**identity, *history);
  return std::ranges::binary_search(others, id) ? kOfOtherMachine : "";
}

Result<MachineIdentity> decide_identity(const fs::path& data_dir, const ComputerMarks& here,
                                        const IdentityDecision& decision) {
  auto known = read_identity(data_dir);
  const bool exists = known && known->has_value();
  IdentityEvent event{.action = decision.action,
                      .machine_id = exists ? (*known)->machine_id : std::string{},
                      .who = decision.who,
                      .why = decision.why,
                      .when = decision.when,
                      .store = end_of_store(data_dir)};
  if (decision.action == IdentityAction::Kept && !exists) {
    ABBE_TRY(known);
    return fail(ErrorCode::Refused, fmt::format("{}: there is no identity to keep; abbed makes it "
                                                "at its first start",
                                                identity_file(data_dir).string()));
  }

  Result<MachineIdentity> decided = exists ? std::move(**known) : MachineIdentity{};
  if (decision.action == IdentityAction::Renewed) {
    decided = new_identity(here, std::move(decided->events), std::move(event));
    if (!decided) return decided;
  } else {
    decided->computer = here;
    decided->events.push_back(std::move(event));
  }
  ABBE_TRY(write_identity(data_dir, *decided));
  return decided;
}

}  // namespace abbe::daemon
