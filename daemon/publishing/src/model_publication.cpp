#include "abbe/publishing/model_publication.hpp"

#include <fmt/format.h>

#include "abbe/messages/cdr.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

template <class T>
Result<std::vector<std::byte>> encoded(const T& message, const PublishedModel& model) {
  std::vector<std::byte> payload;
  if (const auto done = encode(message, payload); !done)
    return fail(ErrorCode::Refused,
                fmt::format("model {} cannot be published: {}", model.id, done.error().text));
  return payload;
}

}  // namespace

Result<ModelPublication> encode_model(const PublishedModel& model, std::string_view machine) {
  const Stamp stamp{.machine = machine};
  ModelPublication out;
  auto payload = encoded(model_message(model, stamp), model);
  ABBE_TRY(payload);
  out.model = std::move(*payload);
  for (const auto& slice : grid_messages(model, stamp)) {
    payload = encoded(slice, model);
    ABBE_TRY(payload);
    out.slices.push_back(std::move(*payload));
  }
  return out;
}

}  // namespace abbe::daemon
