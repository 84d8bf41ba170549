#pragma once
/// The encoded payloads of ErrorModel and ErrorGrid of a model. Encoding takes long (4096 nodes
/// with covariance); therefore the thread that reads the model encodes it, and the publisher only
/// sets the sequence numbers. Pure, thread-safe; allocates.

#include <cstddef>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/publishing/idl_messages.hpp"

namespace abbe::daemon {

/// Encoded payloads with sequence number 0.
struct ModelPublication {
  std::vector<std::byte> model;                ///< ErrorModel
  std::vector<std::vector<std::byte>> slices;  ///< ErrorGrid
};

/// Encodes the messages of a model. Error Refused if the model exceeds the bounds of the IDL.
[[nodiscard]] Result<ModelPublication> encode_model(const PublishedModel& model,
                                                    std::string_view machine);

}  // namespace abbe::daemon
