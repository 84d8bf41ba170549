// Any bytes as the answers of a Modbus device, over TCP and RTU, cut into pieces by the first byte:
// samples hold what is plausible or NaN, and every request that decodes encodes to the same bytes.
// libFuzzer: -max_len=600

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "abbe/drivers/environment/known_maps.hpp"
#include "abbe/drivers/environment/receiver.hpp"

namespace {

using namespace abbe::drivers;

void require(bool holds) {
  if (!holds) std::abort();
}

void round_trip(std::span<const std::byte> bytes, modbus::Transport transport) {
  const auto request = modbus::decode_request(bytes, transport);
  if (!request) return;
  std::array<std::byte, modbus::kMaxAduSize> out{};
  const auto n = modbus::encode(*request, transport, out);
  require(n == bytes.size() && std::equal(bytes.begin(), bytes.end(), out.begin()));
}

void answers(std::span<const std::byte> bytes, modbus::Transport transport,
             const RegisterMap& map) {
  EnvironmentReceiver receiver{map, transport};
  receiver.begin();
  auto told = EnvironmentFailure::Kind::None;

  while (!bytes.empty()) {
    if (const auto request = receiver.next_request()) receiver.sent(*request, {});
    const std::size_t piece =
        std::min<std::size_t>(bytes.size(), 1 + std::to_integer<std::size_t>(bytes[0]) % 32);
    const auto progress = receiver.push(bytes.first(piece), {});
    bytes = bytes.subspan(piece);
    if (progress == EnvironmentReceiver::Progress::Failed) {
      const auto& failure = receiver.failure();
      if (failure.kind != told) require(!text_of(failure, receiver.map()).empty());
      told = failure.kind;  // text takes longer than all the rest
      receiver.begin();
    }
    if (progress != EnvironmentReceiver::Progress::Sample) continue;
    const auto& s = receiver.sample();
    require(std::isnan(s.air_pressure_Pa) ||
            (s.air_pressure_Pa >= 50'000.0 && s.air_pressure_Pa <= 120'000.0));
    for (const double t : s.temperature_K) require(std::isnan(t) || (t > 200.0 && t < 500.0));
  }
}

RegisterMap unproven(std::string_view name, const KnownMapOptions& options) {
  auto map = known_map(name, options).value();
  map.proving.clear();  // else no input would get past them
  return map;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const RegisterMap vaisala = unproven("vaisala-indigo520-hmp", {});
  static const RegisterMap rtd = unproven("icpdas-zt2005-c8", {.inputs = {0, 1, std::nullopt, 7}});
  const auto bytes = std::as_bytes(std::span{data, size});
  for (const auto transport : {modbus::Transport::Tcp, modbus::Transport::Rtu}) {
    round_trip(bytes, transport);
    answers(bytes, transport, vaisala);
    answers(bytes, transport, rtd);
  }
  return 0;
}
