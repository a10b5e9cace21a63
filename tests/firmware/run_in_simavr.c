/* Runs an AVR program in simavr: pulses in at ICP1, bytes of the serial line out.
 *
 *   run_in_simavr ESC_COUNTER.elf END_US [CRASH_US]   < times of rising edges in us, one a line
 *
 * Prints a line "time_us byte" for each byte sent. At CRASH_US the processor is sent into an endless loop with
 * interrupts off, as a program that has crashed.
 */
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MHZ 16
#define PULSE_US 5 /* width of a pulse */

static avr_t *avr;

static void sent(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    (void)param;
    printf("%.3f %u\n", (double)avr->cycle / MHZ, value & 0xFF);
}

int main(int argc, char **argv) {
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (argc < 3 || elf_read_firmware(argv[1], &firmware)) {
        return 2;
    }
    double end = atof(argv[2]), crash = argc > 3 ? atof(argv[3]) : -1;
    firmware.frequency = MHZ * 1000000;
    avr = avr_make_mcu_by_name("atmega328p");
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    avr->log = LOG_NONE;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)AVR_UART_FLAG_STDIO;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
    avr_irq_t *input = avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ('1'), TIMER_IRQ_IN_ICP);

    double next, fall = -1;
    int more = scanf("%lf", &next) == 1;
    while ((double)avr->cycle / MHZ < end) {
        double now = (double)avr->cycle / MHZ;
        if (fall >= 0 && now >= fall) {
            avr_raise_irq(input, 0);
            fall = -1;
        }
        if (more && now >= next) {
            avr_raise_irq(input, 1);
            fall = next + PULSE_US;
            more = scanf("%lf", &next) == 1;
        }
        if (crash >= 0 && now >= crash) {
            avr->sreg[S_I] = 0;
            avr->flash[0x7F00] = 0xFF; /* rjmp to itself: 0xCFFF */
            avr->flash[0x7F01] = 0xCF;
            avr->pc = 0x7F00;
            crash = -1;
        }
        int state = avr_run(avr);
        if (state == cpu_Crashed || state == cpu_Done) {
            return 1;
        }
    }
    return 0;
}
