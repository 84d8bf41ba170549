#pragma once
/// The member "verdict" of model.json.

#include <optional>
#include <string>

#include "abbe/model/model_document.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// `text` as a JSON string; invalid UTF-8 is replaced.
[[nodiscard]] std::string quoted_json(std::string_view text);

/// The value of the member, with the checksum over model_id() and the verdict.
[[nodiscard]] std::string verdict_to_json(const ModelDocument& document);

/// Reads the verdict and adds faults; nullopt: the file has none. The checksum is checked by
/// verdict_is_whole().
[[nodiscard]] std::optional<ModelVerdict> read_verdict(ModelReader& in);
/// False if the verdict in the text is not the one that was written with this model.
[[nodiscard]] bool verdict_is_whole(const ModelReader& in, const ModelDocument& document);

}  // namespace abbe::daemon
