#include <arpa/inet.h>
#include <fmt/format.h>

#include <array>

#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

bool is_numeric_address(const std::string& address) {
  std::array<std::byte, sizeof(in6_addr)> binary{};
  return ::inet_pton(AF_INET, address.c_str(), binary.data()) == 1 ||
         ::inet_pton(AF_INET6, address.c_str(), binary.data()) == 1;
}

}  // namespace

MtconnectConfig read_mtconnect(Section section) {
  MtconnectConfig out;
  if (section.get("address", out.address) && !is_numeric_address(out.address))
    section.fault("address",
                  fmt::format("\"{}\": must be a numeric address of this computer, for example "
                              "127.0.0.1, or 0.0.0.0 for all",
                              out.address));
  section.get_integer("port", out.port, 0, 65535);
  section.get("heartbeat_s", out.heartbeat, kPlain, {0.1, 60.0});
  section.close();
  return out;
}

Result<MtconnectSettings> load_mtconnect_settings(const std::filesystem::path& file) {
  const auto text = read_configuration_text(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file.string());
  ABBE_TRY(table);

  Faults faults(file.string(), kMostConfigFaults);
  Section root(&*table, "", {1, 1}, faults);
  const Config config = read_all(root, file.parent_path());
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return MtconnectSettings{.control_socket = config.control.socket,
                           .mtconnect = read_mtconnect(root.child("mtconnect"))};
}

}  // namespace abbe::daemon
