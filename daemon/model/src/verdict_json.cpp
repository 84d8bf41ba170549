#include "verdict_json.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {
namespace {

constexpr const char* kKey = "verdict";

std::string strings_of(const std::vector<std::string>& texts) {
  std::vector<std::string> quoted;
  for (const std::string& text : texts) quoted.push_back(quoted_json(text));
  return fmt::format("[{}]", fmt::join(quoted, ",\n      "));
}

std::string forced_of(const StoreActor& actor) {
  return fmt::format(",\n    \"forced\": {{\"who\": {}, \"why\": {}, \"when\": {}}}",
                     quoted_json(actor.who), quoted_json(actor.why),
                     quoted_json(to_text(actor.when)));
}

/// The text of all members of the verdict except the checksum.
std::string members_of(const ModelVerdict& verdict) {
  return fmt::format("\"state\": {},\n    \"reasons\": {},\n    \"notes\": {}{}",
                     quoted_json(name(state_of(verdict))), strings_of(verdict.reasons),
                     strings_of(verdict.notes), verdict.forced ? forced_of(*verdict.forced) : "");
}

/// The checksum of the verdict. It includes the id of the model, so that a verdict on another model
/// does not match. Texts that are read again give the same checksum, because invalid UTF-8 was
/// replaced before.
std::string checksum_of(const ModelDocument& document) {
  return sha256_hex(model_id(document) + "\n" + members_of(*document.verdict));
}

std::vector<std::string> read_strings(ModelReader& in, const ModelJson& entry, const char* key) {
  std::vector<std::string> texts;
  const ModelJson* list = in.find(entry, kKey, key);
  if (list == nullptr) return texts;
  if (!list->is_array()) in.fault(std::string("verdict.") + key, "must be an array of strings");
  for (const ModelJson& text : *list) {
    if (text.is_string())
      texts.push_back(text.get<std::string>());
    else
      in.fault(std::string("verdict.") + key, "must be an array of strings");
  }
  return texts;
}

StoreActor read_forced(ModelReader& in, const ModelJson& entry) {
  const std::string path = "verdict.forced";
  StoreActor actor{in.text_of(entry, path, "who"), in.text_of(entry, path, "why")};
  if (const auto when = utc_from_text(in.text_of(entry, path, "when")))
    actor.when = *when;
  else
    in.fault(path + ".when", "must be a UTC time such as 2024-05-17T08:30:00.000000000Z");
  return actor;
}

}  // namespace

std::string quoted_json(std::string_view text) {
  return json_text(nlohmann::json(text));
}

std::string verdict_to_json(const ModelDocument& document) {
  return fmt::format("{{{},\n    \"sha256\": \"{}\"}}", members_of(*document.verdict),
                     checksum_of(document));
}

std::optional<ModelVerdict> read_verdict(ModelReader& in) {
  if (!in.root().is_object() || !in.root().contains(kKey)) return std::nullopt;
  const ModelJson& entry = in.root().at(kKey);
  const std::string state = in.text_of(entry, kKey, "state");
  ModelVerdict verdict{.accepted = state == name(VerdictState::Accepted),
                       .reasons = read_strings(in, entry, "reasons"),
                       .notes = read_strings(in, entry, "notes")};
  if (entry.is_object() && entry.contains("forced"))
    verdict.forced = read_forced(in, entry.at("forced"));
  if (state != name(state_of(verdict)))
    in.fault("verdict.state", R"(must be "accepted", "refused" or, with "forced", "forced")");
  return verdict;
}

bool verdict_is_whole(const ModelReader& in, const ModelDocument& document) {
  if (!document.verdict) return true;
  const ModelJson& entry = in.root().at(kKey);
  return entry.contains("sha256") && entry.at("sha256") == checksum_of(document);
}

}  // namespace abbe::daemon
