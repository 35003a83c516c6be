/* The least that receives and sends, for bench/faults: minimal_relay OUT BUS [BUS [clocks]]
   Reads the frames of two gyros and answers each frame of gyro 2 with one frame. One bus: read and write alone;
   two: a poll before them. `clocks`: it also reads both clocks whenever it wakes up; under User Mode Linux that is a
   system call each, elsewhere none. */

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static int open_bus(const char *name) {
  const struct can_filter filters[2] = {{0x101, CAN_SFF_MASK}, {0x102, CAN_SFF_MASK}};
  struct sockaddr_can address = {.can_family = AF_CAN};
  int fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  address.can_ifindex = (int)if_nametoindex(name);
  setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters, sizeof filters);
  if (fd < 0 || bind(fd, (struct sockaddr *)&address, sizeof address) != 0) {
    perror(name);
    exit(1);
  }
  return fd;
}

static void relay(int from, int to) {
  struct can_frame frame;
  if (read(from, &frame, sizeof frame) != sizeof frame) exit(1);
  if (frame.can_id != 0x102) return;
  frame.can_id = 0x610;
  if (write(to, &frame, sizeof frame) != sizeof frame) perror("write");
}

int main(int argc, char **argv) {
  if (argc < 3) return 2;
  const int in = open_bus(argv[2]);
  const int out = open_bus(argv[1]);
  setsockopt(out, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0);
  if (argc == 3) {
    for (;;) relay(in, out);
  }
  struct pollfd buses[2] = {{in, POLLIN, 0}, {open_bus(argv[3]), POLLIN, 0}};
  for (;;) {
    if (poll(buses, 2, -1) < 0) return 1;
    if (argc > 4) {
      struct timespec now;
      clock_gettime(CLOCK_REALTIME, &now);
      clock_gettime(CLOCK_MONOTONIC, &now);
    }
    for (int i = 0; i < 2; ++i) {
      if (buses[i].revents != 0) relay(buses[i].fd, out);
    }
  }
}
