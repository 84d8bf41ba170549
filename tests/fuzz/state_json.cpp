// Any bytes as state.json: a state or an error; what is taken reads back as the same state.
// libFuzzer: -max_len=4096

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "store_state.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace abbe::daemon;  // NOLINT(google-build-using-namespace): a program, not a header
  const auto state =
      store_state_from_text({reinterpret_cast<const char*>(data), size}, "state.json");
  if (!state) return 0;
  (void)state->activation();
  const std::string once = to_text(*state);
  const auto again = store_state_from_text(once, "state.json");
  if (!again || to_text(*again) != once || again->active() != state->active()) std::abort();
  return 0;
}
