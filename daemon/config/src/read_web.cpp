#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

enum class Reach { Invalid, ThisComputer, Network };

Reach reach_of(const std::string& address) {
  if (in_addr v4{}; ::inet_pton(AF_INET, address.c_str(), &v4) == 1)
    return (ntohl(v4.s_addr) >> 24) == 127 ? Reach::ThisComputer : Reach::Network;
  if (in6_addr v6{}; ::inet_pton(AF_INET6, address.c_str(), &v6) == 1)
    return IN6_IS_ADDR_LOOPBACK(&v6) ? Reach::ThisComputer : Reach::Network;
  return Reach::Invalid;
}

void check_reach(Section& section, const WebConfig& web) {
  const Reach reach = reach_of(web.address);
  if (reach == Reach::Invalid)
    section.fault("address",
                  fmt::format("\"{}\": must be a numeric address of this computer, for example "
                              "127.0.0.1 or ::1",
                              web.address));
  if (reach == Reach::Network && !web.tls())
    section.fault("address",
                  fmt::format("other computers can reach {}: certificate and key are required, "
                              "else passwords would be readable on the network",
                              web.address));
  if (web.certificate.empty() != web.key.empty())
    section.fault(web.key.empty() ? "certificate" : "key",
                  "certificate and key are needed together");
}

}  // namespace

WebConfig read_web(Section section, const std::filesystem::path& base) {
  WebConfig web;
  section.get("address", web.address);
  section.get_integer("port", web.port, 0, 65535);
  section.get("certificate", web.certificate, base);
  section.get("key", web.key, base);
  section.get("host_names", web.host_names);
  section.get("users", web.users, base);
  section.get("view_without_login", web.view_without_login);
  constexpr Unit kMinutes{1.0 / 60.0};
  section.get("session_idle_min", web.session_idle, kMinutes, {1.0, 12.0 * 60.0});
  section.get("live_hz", web.live_hz, kPlain, {1.0, 100.0});
  section.get_integer("most_pages", web.most_pages, 1, 64);
  check_reach(section, web);
  section.close();
  return web;
}

Result<WebSettings> load_web_settings(const std::filesystem::path& file) {
  const auto text = read_configuration_text(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file.string());
  ABBE_TRY(table);
  Faults faults(file.string(), kMostConfigFaults);
  Section root(&*table, "", {1, 1}, faults);
  WebSettings settings{.config = read_all(root, file.parent_path()), .web = {}};
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  settings.web = read_web(root.child("web"), file.parent_path());
  return settings;
}

}  // namespace abbe::daemon
