#include "cli/status/gateway_client.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <systemd/sd-bus.h>
#include <utility>

#include "base/instance_name.h"

namespace vgyro::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kInterface = "org.vgyro.Gateway1";
constexpr const char* kPath = "/org/vgyro/Gateway1";
constexpr std::uint64_t kPatienceUsec = 5'000'000;
// A memory card may take this long to sync a capture.
constexpr std::uint64_t kCapturePatienceUsec = 120'000'000;
constexpr int kDepthMost = 8;

/// Reads a message as JSON. The sender is not trusted: a value that cannot be read is null and ends
/// the reading.
class Reader {
 public:
  explicit Reader(sd_bus_message* message) : message_(message) {}

  Json value(int depth = 0) {
    char type = 0;
    const char* contents = nullptr;
    if (!good(sd_bus_message_peek_type(message_, &type, &contents)) || depth > kDepthMost)
      return give_up();
    switch (type) {
      case 's':
      case 'o':
      case 'g':
        return text(type);
      case 'd':
        return number();
      case 'b':
        return basic<int>('b') != 0;
      case 'u':
        return basic<std::uint32_t>('u');
      case 't':
        return basic<std::uint64_t>('t');
      case 'a':
      case 'v':
        return container(type, contents, depth);
      default:
        return give_up();
    }
  }

 private:
  bool good(int result) {
    if (result < 0) failed_ = true;
    return !failed_ && result > 0;
  }
  Json give_up() {
    failed_ = true;
    return nullptr;
  }

  template <class T>
  T basic(char type) {
    T value{};
    good(sd_bus_message_read_basic(message_, type, &value));
    return value;
  }
  Json number() {
    const auto value = basic<double>('d');
    return std::isfinite(value) ? Json(value) : Json();
  }
  Json text(char type) {
    const char* const value = basic<const char*>(type);
    return value == nullptr ? give_up() : Json(std::string(value));
  }

  Json container(char type, const char* contents, int depth) {
    const std::string inner(contents);
    if (!good(sd_bus_message_enter_container(message_, type, contents))) return give_up();
    Json result;
    if (type == 'v') {
      result = value(depth + 1);
    } else if (inner.front() == '{') {
      result = dictionary(inner.substr(1, inner.size() - 2), depth);
    } else {
      result = Json::array();
      while (!failed_ && sd_bus_message_at_end(message_, 0) == 0)
        result.push_back(value(depth + 1));
    }
    good(sd_bus_message_exit_container(message_));
    return result;
  }

  Json dictionary(const std::string& entry, int depth) {
    Json object = Json::object();
    while (good(sd_bus_message_enter_container(message_, 'e', entry.c_str()))) {
      const Json key = text('s');
      Json content = value(depth + 1);
      if (key.is_string()) object[key.get<std::string>()] = std::move(content);
      good(sd_bus_message_exit_container(message_));
    }
    return object;
  }

  sd_bus_message* message_;
  bool failed_ = false;
};

// "RateDps" → "rate_dps"
std::string snake_case(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const auto letter = static_cast<unsigned char>(c);
    if (std::isupper(letter) != 0 && !out.empty()) out += '_';
    out += static_cast<char>(std::tolower(letter));
  }
  return out;
}

struct Reply {
  sd_bus_message* message = nullptr;
  sd_bus_error error = SD_BUS_ERROR_NULL;
  Reply() = default;
  Reply(const Reply&) = delete;
  Reply& operator=(const Reply&) = delete;
  ~Reply() {
    sd_bus_message_unref(message);
    sd_bus_error_free(&error);
  }
};

tl::unexpected<Error> why(const Reply& reply, int result, const std::string& unit) {
  if (sd_bus_error_has_names(&reply.error, SD_BUS_ERROR_SERVICE_UNKNOWN,
                             SD_BUS_ERROR_NAME_HAS_NO_OWNER, nullptr) != 0) {
    return fail(unit, "no gateway answers on D-Bus",
                "`systemctl status " + unit + "` says whether it runs, `journalctl -u " + unit +
                    "` what troubles it");
  }
  if (sd_bus_error_has_name(&reply.error, SD_BUS_ERROR_ACCESS_DENIED) != 0) {
    return fail(unit, "only root may do this", "try it again with sudo");
  }
  if (result == -ETIMEDOUT || sd_bus_error_has_name(&reply.error, SD_BUS_ERROR_NO_REPLY) != 0) {
    return fail(unit, "does not answer", "`systemctl status " + unit + "` shows why");
  }
  if (reply.error.message != nullptr) return fail(unit, reply.error.message);
  return fail(unit, system_reason(-result));
}

}  // namespace

void GatewayClient::Close::operator()(sd_bus* bus) const {
  sd_bus_flush_close_unref(bus);
}

Expected<GatewayClient> GatewayClient::connect(std::string_view instance) {
  sd_bus* bus = nullptr;
  const int result = sd_bus_open_system(&bus);
  if (result < 0) {
    return fail("D-Bus", "there is no system bus: " + system_reason(-result),
                "`apt install dbus` and `systemctl start dbus` make one");
  }
  GatewayClient client(bus, instance);
  sd_bus_set_method_call_timeout(bus, kPatienceUsec);
  return client;
}

Expected<std::vector<std::string>> GatewayClient::instances() {
  char** names = nullptr;
  const int result = sd_bus_list_names(bus_.get(), &names, nullptr);
  if (result < 0) return fail("D-Bus", "does not list its names: " + system_reason(-result));
  std::vector<std::string> found;
  const std::string prefix = std::string(kGatewayBusName) + '.';
  for (char** name = names; *name != nullptr; ++name) {
    const std::string_view whole(*name);
    if (whole == kGatewayBusName) found.emplace_back();
    if (whole.starts_with(prefix)) found.emplace_back(whole.substr(prefix.size()));
    std::free(*name);
  }
  std::free(names);
  std::sort(found.begin(), found.end());
  return found;
}

Expected<nlohmann::ordered_json> GatewayClient::status() {
  Reply reply;
  const int result = sd_bus_call_method(bus_.get(), bus_name_of(instance_).c_str(), kPath,
                                        "org.freedesktop.DBus.Properties", "GetAll", &reply.error,
                                        &reply.message, "s", kInterface);
  if (result < 0) return why(reply, result, unit_of(instance_));
  Json status = {{"format", 1}};
  const Json properties = Reader(reply.message).value();
  if (!properties.is_object()) return fail("vgyrod", "its answer cannot be read");
  for (const auto& [name, value] : properties.items())
    status[snake_case(name)] = value;
  return status;
}

Expected<std::string> GatewayClient::capture() {
  Reply reply;
  sd_bus_set_method_call_timeout(bus_.get(), kCapturePatienceUsec);
  const int result = sd_bus_call_method(bus_.get(), bus_name_of(instance_).c_str(), kPath,
                                        kInterface, "Capture", &reply.error, &reply.message, "");
  if (result < 0) return why(reply, result, unit_of(instance_));
  const Json folder = Reader(reply.message).value();
  if (!folder.is_string()) return fail(unit_of(instance_), "its answer cannot be read");
  return folder.get<std::string>();
}

Expected<void> GatewayClient::call(const char* method) {
  Reply reply;
  const int result = sd_bus_call_method(bus_.get(), bus_name_of(instance_).c_str(), kPath,
                                        kInterface, method, &reply.error, &reply.message, "");
  if (result < 0) return why(reply, result, unit_of(instance_));
  return {};
}

}  // namespace vgyro::cli
