// Any bytes as model.json: a model or an error, and what is taken as a model has the hash it
// states. libFuzzer: -max_len=4096

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "abbe/model/model_document.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text{reinterpret_cast<const char*>(data), size};
  const auto document = abbe::daemon::parse_model(text, "model.json");
  if (document && text.find(model_hash(*document)) == std::string_view::npos) std::abort();
  if (!document && document.error().text.empty()) std::abort();
  return 0;
}
