#pragma once
/// A model as it is published: the payloads of ErrorModel and ErrorGrid, encoded where the model
/// was read, because that takes long (4096 nodes with covariance). Who publishes them only fills in
/// the sequence numbers. Pure, thread-safe; allocates.

#include <cstddef>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/publishing/idl_messages.hpp"

namespace abbe::daemon {

/// The sequence numbers are 0.
struct ModelPublication {
  std::vector<std::byte> model;                ///< ErrorModel
  std::vector<std::vector<std::byte>> slices;  ///< ErrorGrid
};

/// Refused for a model that does not fit into the bounds of the IDL.
[[nodiscard]] Result<ModelPublication> encode_model(const ModelInForce& model,
                                                    std::string_view machine);

}  // namespace abbe::daemon
