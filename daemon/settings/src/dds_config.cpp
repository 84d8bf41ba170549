#include "abbe/settings/dds_config.hpp"

#include "abbe/base/faults.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"

namespace abbe::daemon {

namespace {

/// The default socket. If systemd runs abbe-dds, its user cannot enter the folder of the control
/// socket, so another folder is used.
std::filesystem::path default_socket(std::filesystem::path folder, Supervise supervise) {
  if (supervise == Supervise::Systemd) folder += "-dds";
  return folder / "dds.sock";
}

}  // namespace

void read_dds(Section& section, const std::filesystem::path& base,
              const std::filesystem::path& runtime_dir, DdsConfig& out) {
  // The domain ids 0 to 232 give valid UDP port numbers [DDSI-RTPS 2.2, 9.6.1.1].
  section.get_integer("domain", out.domain, 0, 232);

  // A rate of 0 means: a sample with every hub cycle that has new data. The hub period and the
  // rates of the devices then limit the rate.
  section.get("snapshot_hz", out.snapshot_hz, kPlain, {0.0, 1000.0});
  section.get("compensation_hz", out.compensation_hz, kPlain, {0.0, 1000.0});
  section.get_integer("priority", out.priority, 0, 99);
  section.get("validity_s", out.validity, kPlain, {0.01, 3600.0});
  section.get_word<Supervise>(
      "supervise", out.supervise,
      {{"child", Supervise::Child}, {"systemd", Supervise::Systemd}, {"off", Supervise::Off}});
  section.get("profile", out.profile, base);
  section.get("security", out.security, base);
  section.get_maybe_empty("user", out.user);
  section.get("socket", out.socket, base);
  if (out.socket.empty()) out.socket = default_socket(runtime_dir, out.supervise);
}

void use_dds_unit(DdsConfig& dds, const std::filesystem::path& runtime_dir, bool unit) {
  if (dds.supervise != Supervise::ByStart) return;
  const bool by_default = dds.socket == default_socket(runtime_dir, dds.supervise);
  dds.supervise = unit ? Supervise::Systemd : Supervise::Child;
  if (by_default) dds.socket = default_socket(runtime_dir, dds.supervise);
}

Result<ParticipantConfig> parse_participant_config(std::string_view text,
                                                   const std::filesystem::path& file) {
  const auto table = parse_toml(text, file.string());
  ABBE_TRY(table);

  Faults faults(file.string(), kMostConfigFaults);
  Section root(&*table, "", {1, 1}, faults);
  ParticipantConfig out;
  root.child("daemon").get("runtime_dir", out.runtime_dir, file.parent_path());
  Section dds = root.child("dds");
  read_dds(dds, file.parent_path(), out.runtime_dir, out.dds);
  dds.close();
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return out;
}

Result<ParticipantConfig> load_participant_config(const std::filesystem::path& file) {
  const auto text = read_configuration_text(file);
  ABBE_TRY(text);
  return parse_participant_config(*text, file);
}

}  // namespace abbe::daemon
